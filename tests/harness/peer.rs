//! A peer of the master that says whatever a test wants: bytes, or messages of the protocol.

use std::{
    io::{ErrorKind, Read as _, Write as _},
    net::{SocketAddr, TcpStream},
    time::{Duration, Instant},
};

use protocol::{
    FrameId, Key, Radiance, Task, ToMaster, ToWorker,
    envelope::{Decoded, Decoder, encode},
    limits::OPENING_BYTES,
    message::{Assign, Hello, Pong, Prepared, Request, TaskResult},
    radiance::Encoding,
    secure::{Caller, Channel},
    settings::Settings,
    version::{MAGIC, PROTOCOL},
};

/// A master answers within this time, however busy the machine is.
const PATIENCE: Duration = Duration::from_secs(30);

/// A connection to a master.
#[derive(Debug)]
pub struct Peer {
    stream: TcpStream,
    decoder: Decoder,
    /// Once the master has answered a call.
    channel: Option<Channel>,
    /// All bytes that were sent.
    sent: Vec<u8>,
}

/// A frame as a peer knows it.
#[derive(Debug, Clone)]
pub struct PeerFrame {
    /// Its number.
    pub id: FrameId,
    /// The workload.
    pub settings: Settings,
    /// What the peer was given to do.
    pub tasks: Vec<Task>,
}

impl Peer {
    /// Connects and says nothing.
    pub fn connect(master: SocketAddr) -> Self {
        let stream = TcpStream::connect(master).expect("the master accepts connections");
        stream
            .set_read_timeout(Some(PATIENCE))
            .expect("a timeout can be set");
        let mut decoder = Decoder::new();
        decoder.handshake_done();
        Self {
            stream,
            decoder,
            channel: None,
            sent: Vec::new(),
        }
    }

    /// Connects and opens a secure channel, which the master must answer.
    #[track_caller]
    pub fn connect_with_key(master: SocketAddr, key: &Key) -> Self {
        let mut peer = Self::connect(master);
        let (caller, call) = Caller::call(key).expect("a call can be made");
        peer.send_bytes(&call);
        let mut answer = [0; OPENING_BYTES];
        let answered = peer.stream.read_exact(&mut answer);
        answered.expect("the master answers");
        peer.channel = Some(caller.answered(&answer).expect("the master has the key"));
        peer
    }

    /// Joins as a worker of one slot and asks for tasks until it has some.
    #[track_caller]
    pub fn with_tasks(master: SocketAddr, name: &str) -> (Self, PeerFrame) {
        let mut peer = Self::connect(master);
        peer.send(&ToMaster::Hello(hello(name)));
        // The scene itself is of no interest to this peer.
        let prepared = |digest| Prepared {
            digest,
            load_us: 1,
            bvh_us: 1,
        };
        let frame = loop {
            match peer.receive() {
                Some(ToWorker::Prepare(prepare)) => {
                    peer.send(&ToMaster::Prepared(prepared(prepare.scene.digest)));
                }
                Some(ToWorker::Frame(frame)) => break frame,
                Some(_) => {}
                None => panic!("the master closed before there was a frame"),
            }
        };
        let request = Request {
            frame: frame.frame,
            tasks: 2,
        };
        peer.send(&ToMaster::Request(request));
        let tasks = loop {
            match peer.receive() {
                Some(ToWorker::Assign(Assign { tasks, .. })) if !tasks.is_empty() => break tasks,
                Some(_) => {}
                None => panic!("the master closed before there were tasks"),
            }
        };
        let frame = PeerFrame {
            id: frame.frame,
            settings: frame.settings,
            tasks,
        };
        (peer, frame)
    }

    /// Sends bytes as they are.
    pub fn send_bytes(&mut self, bytes: &[u8]) {
        // A master that has closed already is what many tests are about.
        let _ = self.stream.write_all(bytes);
        self.sent.extend_from_slice(bytes);
    }

    /// Sends a message.
    pub fn send(&mut self, message: &ToMaster) {
        self.send_envelope(&encode(message).expect("a message within the limits"));
    }

    /// Sends the bytes of a message, sealed if the channel is.
    pub fn send_envelope(&mut self, envelope: &[u8]) {
        let Some(channel) = &mut self.channel else {
            return self.send_bytes(envelope);
        };
        let mut sealed = Vec::new();
        let done = channel.sealer.seal(envelope, &mut sealed);
        done.expect("what is said can be sealed");
        self.send_bytes(&sealed);
    }

    /// All that was sent so far, as somebody on the way could record it.
    pub fn recorded(&self) -> Vec<u8> {
        self.sent.clone()
    }

    /// The next message, pings answered on the way; `None` if the master has closed.
    #[track_caller]
    pub fn receive(&mut self) -> Option<ToWorker> {
        let begun = Instant::now();
        loop {
            match self.decoder.decode().expect("a master speaks the protocol") {
                Decoded::Message(ToWorker::Ping(ping)) => {
                    assert!(begun.elapsed() < PATIENCE, "the master does nothing but ping");
                    self.send(&ToMaster::Pong(Pong { nonce: ping.nonce }));
                }
                Decoded::Message(message) => return Some(message),
                Decoded::Incomplete { .. } => self.read().then_some(())?,
            }
        }
    }

    /// Waits until the master closes, and returns what it said before.
    #[track_caller]
    pub fn until_closed(mut self) -> Vec<ToWorker> {
        let mut said = Vec::new();
        while let Some(message) = self.receive() {
            said.push(message);
        }
        said
    }

    /// False if the master has closed.
    #[track_caller]
    fn read(&mut self) -> bool {
        let read = match &mut self.channel {
            Some(channel) => self.stream.read(channel.opener.space()),
            None => self.stream.read(self.decoder.space()),
        };
        match read {
            Ok(bytes) => {
                self.take(bytes);
                bytes > 0
            }
            // The master did not read all that it was sent.
            Err(error) if error.kind() == ErrorKind::ConnectionReset => false,
            Err(error) => panic!("the master neither speaks nor closes: {error}"),
        }
    }

    /// Takes so many bytes that were just read.
    #[track_caller]
    fn take(&mut self, bytes: usize) {
        let Some(channel) = &mut self.channel else {
            return self.decoder.filled(bytes);
        };
        channel.opener.filled(bytes);
        while let Some(piece) = channel.opener.open().expect("a master seals what it says") {
            self.decoder.push(piece);
        }
    }
}

/// A hello as it should be.
pub fn hello(name: &str) -> Hello {
    Hello {
        magic: MAGIC.to_owned(),
        protocol: PROTOCOL,
        version: "of a test".to_owned(),
        name: name.to_owned(),
        slots: 1,
        token: None,
    }
}

impl PeerFrame {
    /// A result with the same value everywhere.
    pub fn result(&self, task: Task, pixels: u32, value: f32) -> TaskResult {
        TaskResult {
            frame: self.id,
            task,
            pixels,
            radiance: Radiance::pack(
                &vec![value; pixels as usize * task.component.floats_per_pixel()],
                Encoding::Exact,
            ),
            primary_rays: 0,
            shadow_rays: 0,
            busy_us: 1,
        }
    }

    /// Pixels of a task, if the picture divides evenly.
    pub fn pixels_per_task(&self) -> u32 {
        self.settings.width * self.settings.height / self.settings.groups
    }
}
