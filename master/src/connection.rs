//! One worker's connection: the handshake, then messages in and out. Decides nothing about the frame.

use std::{net::SocketAddr, sync::Arc};

use protocol::{
    ToMaster, ToWorker, WorkerId,
    connection::{ReadError, Reader, WriteError, Writer},
    envelope::Sealed,
    limits,
    message::{Hello, Refused, Welcome},
    version,
};
use tokio::{
    net::{TcpStream, tcp::OwnedReadHalf},
    sync::mpsc,
    time::timeout,
};

use crate::{
    cli::VERSION,
    clock::Clock,
    meter::{Metered, Throughput},
};

/// Messages of a worker, their bytes counted.
type Incoming = Reader<ToMaster, Metered<OwnedReadHalf>>;

/// Messages that may wait for a worker to read them. One that lets more pile up is closed.
const OUTBOX_MESSAGES_MAX: usize = 1_024;
/// Encoded bytes that may wait besides; one message more is always taken.
const WRITER_BYTES_MAX: usize = 1 << 20;

/// What a connection tells the frame.
#[derive(Debug)]
pub enum Arrival {
    /// The handshake is done.
    Joined(Joined),
    /// A message arrived.
    Said {
        /// From whom.
        worker: WorkerId,
        /// What.
        message: ToMaster,
    },
    /// A worker that had joined is gone. Its last word.
    Left {
        /// Who.
        worker: WorkerId,
        /// Why, for people; `None` if it closed in good order.
        fault: Option<String>,
    },
}

/// A worker that has just joined.
#[derive(Debug)]
pub struct Joined {
    /// Its number.
    pub worker: WorkerId,
    /// Who it says it is.
    pub hello: Hello,
    /// Where it is.
    pub address: SocketAddr,
    /// Whether this process started it.
    pub is_local: bool,
    /// How fast its bytes come in.
    pub throughput: Throughput,
    /// Where to put messages for it. Dropping it closes the connection.
    pub outbox: mpsc::Sender<Sealed>,
}

/// What all connections of a server share.
#[derive(Debug)]
pub struct Shared {
    /// Where arrivals go.
    pub arrivals: mpsc::Sender<Arrival>,
    /// Tells the worker that this process started.
    pub local_token: String,
    /// Time since the start of the process.
    pub clock: Clock,
}

/// Why a connection ended.
#[derive(Debug, thiserror::Error)]
enum Fault {
    #[error("it did not introduce itself within {} s", limits::HANDSHAKE_WITHIN.as_secs())]
    HandshakeTooSlow,
    #[error("its first message was a `{0}`, not a `hello`")]
    NoHello(&'static str),
    #[error("refused: {0}")]
    Refused(String),
    #[error("it said nothing for {} s", limits::SILENCE.as_secs())]
    Silence,
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Serves one connection to its end.
pub async fn serve(stream: TcpStream, address: SocketAddr, worker: WorkerId, shared: Arc<Shared>) {
    if let Err(error) = protocol::connection::tune(&stream) {
        return tracing::debug!(%address, %error, "a connection failed at once");
    }
    let (incoming, outgoing) = stream.into_split();
    let throughput = Throughput::default();
    let mut reader = Reader::new(Metered::new(incoming, shared.clock, throughput.clone()));
    let mut writer = Writer::new(outgoing);
    let hello = match timeout(
        limits::HANDSHAKE_WITHIN,
        shake_hands(&mut reader, &mut writer, worker),
    )
    .await
    {
        Ok(Ok(Some(hello))) => hello,
        Ok(Ok(None)) => return tracing::debug!(%address, "a peer left without a word"),
        Ok(Err(fault)) => return tracing::warn!(%address, %fault, "a peer was sent away"),
        Err(_) => {
            let fault = Fault::HandshakeTooSlow;
            return tracing::warn!(%address, %fault, "a peer was sent away");
        }
    };
    let (outbox, messages) = mpsc::channel(OUTBOX_MESSAGES_MAX);
    let is_local = hello.token.as_deref() == Some(&shared.local_token);
    let joined = Arrival::Joined(Joined {
        worker,
        hello,
        address,
        is_local,
        throughput,
        outbox,
    });
    if shared.arrivals.send(joined).await.is_err() {
        return;
    }
    let ended = converse(&mut reader, &mut writer, messages, worker, &shared.arrivals).await;
    let fault = ended.err().map(|fault| fault.to_string());
    // If nobody listens any more the program is ending.
    let _ = shared.arrivals.send(Arrival::Left { worker, fault }).await;
}

/// `None` if the peer closed before it said anything.
async fn shake_hands(
    reader: &mut Incoming,
    writer: &mut Writer<ToWorker>,
    worker: WorkerId,
) -> Result<Option<Hello>, Fault> {
    let hello = match reader.read().await? {
        None => return Ok(None),
        Some(ToMaster::Hello(hello)) => hello,
        Some(other) => return Err(Fault::NoHello(protocol::message::Message::name(&other))),
    };
    if let Err(reason) = version::check(&hello, VERSION) {
        let refused = Refused {
            reason: reason.clone(),
        };
        writer.send(&ToWorker::Refused(refused)).await?;
        return Err(Fault::Refused(reason));
    }
    reader.handshake_done();
    let welcome = Welcome {
        worker,
        version: VERSION.to_owned(),
    };
    writer.send(&ToWorker::Welcome(welcome)).await?;
    Ok(Some(hello))
}

/// Carries messages until one side ends it.
async fn converse(
    reader: &mut Incoming,
    writer: &mut Writer<ToWorker>,
    mut messages: mpsc::Receiver<Sealed>,
    worker: WorkerId,
    arrivals: &mpsc::Sender<Arrival>,
) -> Result<(), Fault> {
    loop {
        // What is written meanwhile is no sign of life.
        let heard = timeout(limits::SILENCE, write_until_heard(reader, writer, &mut messages));
        let Some(message) = heard.await.unwrap_or(Err(Fault::Silence))? else {
            return Ok(());
        };
        if arrivals.send(Arrival::Said { worker, message }).await.is_err() {
            return Ok(());
        }
    }
}

/// The next message of the worker; `None` when either side closes in good order.
async fn write_until_heard(
    reader: &mut Incoming,
    writer: &mut Writer<ToWorker>,
    messages: &mut mpsc::Receiver<Sealed>,
) -> Result<Option<ToMaster>, Fault> {
    loop {
        let may_queue = writer.queued_bytes() < WRITER_BYTES_MAX;
        tokio::select! {
            message = reader.read() => return Ok(message?),
            message = messages.recv(), if may_queue => {
                let Some(message) = message else {
                    writer.flush().await.map_err(WriteError::Io)?;
                    return Ok(None);
                };
                writer.push_sealed(message);
            }
            flushed = writer.flush(), if !writer.is_empty() => flushed.map_err(WriteError::Io)?,
        }
    }
}
