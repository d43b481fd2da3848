//! A master that says what a test wants, and a renderer whose light is easy to foretell.
#![allow(dead_code, reason = "each test program uses its own part")]
#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use anyhow::bail;
use protocol::bundle::pack;
use protocol::connection::{Reader, Writer};
use protocol::message::*;
use protocol::radiance::Encoding;
use protocol::settings::{Algorithm, LightPoints, Settings};
use protocol::{Component, Digest, FrameId, Radiance, Task, ToMaster, ToWorker, WorkerId};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::timeout;
use worker::renderer::{Frame as FrameTasks, LoadedScene, Output, Renderer, Scene};

/// Longer than anything takes; a test that waits so long has failed.
const PATIENCE: Duration = Duration::from_secs(20);

/// Listens where a worker can find it.
pub(crate) struct Master {
    listener: TcpListener,
    pub(crate) address: SocketAddr,
}

/// The master's end of a connection.
pub(crate) struct Peer {
    reader: Reader<ToMaster>,
    writer: Writer<ToWorker>,
    /// The scene that was named last.
    scene: Vec<u8>,
    /// Chunks of scenes that were sent.
    pub(crate) chunks_sent: usize,
}

impl Master {
    pub(crate) async fn listen() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        Self { listener, address }
    }

    pub(crate) async fn accept_bytes(&self) -> TcpStream {
        timeout(PATIENCE, self.listener.accept())
            .await
            .unwrap()
            .unwrap()
            .0
    }

    pub(crate) async fn accept(&self) -> Peer {
        let (reader, writer) = protocol::connection::open(self.accept_bytes().await).unwrap();
        Peer {
            reader,
            writer,
            scene: Vec::new(),
            chunks_sent: 0,
        }
    }

    /// Accepts a worker and welcomes it.
    pub(crate) async fn join(&self) -> (Peer, Hello) {
        let mut peer = self.accept().await;
        let hello = peer.hello().await;
        peer.say(ToWorker::Welcome(Welcome {
            worker: WorkerId(1),
            version: "0.1.0".to_owned(),
        }))
        .await;
        (peer, hello)
    }

    /// Accepts a worker and brings it into the middle of frame 1, with its first tasks asked for.
    pub(crate) async fn join_in_frame(&self, scene: &[u8], settings: Settings) -> (Peer, u32) {
        let (mut peer, _) = self.join().await;
        peer.prepare(scene).await;
        assert!(matches!(peer.hear().await, ToMaster::Prepared(_)));
        peer.say(ToWorker::Frame(Frame {
            frame: FrameId(1),
            settings,
            vpl_sets: Vec::new(),
            radiance: Encoding::Exact,
        }))
        .await;
        let asked = peer.request().await;
        (peer, asked)
    }
}

impl Peer {
    pub(crate) async fn say(&mut self, message: ToWorker) {
        self.writer.send(&message).await.unwrap();
    }

    /// The next message, once the worker has what it wants of the scene.
    pub(crate) async fn hear(&mut self) -> ToMaster {
        loop {
            let message = timeout(PATIENCE, self.reader.read()).await;
            let message = message
                .expect("the worker says something in time")
                .unwrap()
                .expect("the worker stays");
            match message {
                ToMaster::Want(want) => self.send_chunk(want).await,
                message => return message,
            }
        }
    }

    /// Answers until the worker has the whole scene, and hears no further.
    pub(crate) async fn send_scene(&mut self) {
        for _ in &SceneRef::of(&self.scene).chunks {
            let want = self.want().await;
            self.send_chunk(want).await;
        }
    }

    /// The next chunk that is wanted.
    pub(crate) async fn want(&mut self) -> Want {
        let message = timeout(PATIENCE, self.reader.read()).await;
        match message.unwrap().unwrap() {
            Some(ToMaster::Want(want)) => want,
            other => panic!("not a want: {other:?}"),
        }
    }

    pub(crate) async fn send_chunk(&mut self, want: Want) {
        let place = SceneRef::of(&self.scene).chunk(want.chunk).unwrap();
        let data = pack(&self.scene[place]).into();
        let Want { digest, chunk } = want;
        self.chunks_sent += 1;
        self.say(ToWorker::SceneChunk(SceneChunk { digest, chunk, data }))
            .await;
    }

    /// Whether the worker closes next.
    pub(crate) async fn is_closed(&mut self) -> bool {
        !matches!(timeout(PATIENCE, self.reader.read()).await.unwrap(), Ok(Some(_)))
    }

    pub(crate) async fn hello(&mut self) -> Hello {
        match self.hear().await {
            ToMaster::Hello(hello) => {
                self.reader.handshake_done();
                hello
            }
            other => panic!("not a hello: {other:?}"),
        }
    }

    pub(crate) async fn request(&mut self) -> u32 {
        match self.hear().await {
            ToMaster::Request(request) => request.tasks,
            other => panic!("not a request: {other:?}"),
        }
    }

    /// The next result; requests before it are skipped.
    pub(crate) async fn result(&mut self) -> TaskResult {
        loop {
            match self.hear().await {
                ToMaster::Result(result) => return result,
                ToMaster::Request(_) => {}
                other => panic!("not a result: {other:?}"),
            }
        }
    }

    pub(crate) async fn failed(&mut self) -> Failed {
        loop {
            match self.hear().await {
                ToMaster::Failed(failed) => return failed,
                ToMaster::Request(_) => {}
                other => panic!("not a failure: {other:?}"),
            }
        }
    }

    /// The worker's last word; results before it are skipped.
    pub(crate) async fn leaving(&mut self) -> Leaving {
        loop {
            match self.hear().await {
                ToMaster::Leaving(leaving) => return leaving,
                ToMaster::Result(_) | ToMaster::Request(_) => {}
                other => panic!("not a farewell: {other:?}"),
            }
        }
    }

    /// Names a scene, which the worker gets when it wants it.
    pub(crate) async fn prepare(&mut self, scene: &[u8]) {
        self.scene = scene.to_vec();
        let scene = SceneRef::of(scene);
        self.say(ToWorker::Prepare(Prepare { scene })).await;
    }

    pub(crate) async fn assign(&mut self, tasks: Vec<Task>, send_within: Option<Duration>) {
        let send_within_us = send_within.map(|time| time.as_micros() as u64);
        self.say(ToWorker::Assign(Assign {
            frame: FrameId(1),
            tasks,
            send_within_us,
        }))
        .await;
    }
}

pub(crate) fn digest_of(scene: &[u8]) -> Digest {
    SceneRef::of(scene).digest
}

pub(crate) fn settings() -> Settings {
    Settings {
        algorithm: Algorithm::Component,
        width: 64,
        height: 48,
        groups: 4,
        spp: 4,
        vpls: 16,
        vpl_sets: 4,
        seed: 1,
        geometry_clamp: None,
        light_points: LightPoints::PerPass,
    }
}

pub(crate) fn direct(group: u32, index: u32) -> Task {
    Task {
        component: Component::Direct,
        group,
        index,
        passes: 1,
    }
}

/// Takes any bytes but `broken` for a scene. Each pixel takes the given time and shines as bright as its group.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grey {
    pub(crate) pixel: Duration,
}

#[derive(Debug)]
struct GreyFrame {
    pixel: Duration,
    settings: Settings,
}

/// A task of this index breaks the renderer.
pub(crate) const BREAKING: u32 = 3;

impl Renderer for Grey {
    fn load(&self, bytes: &[u8]) -> anyhow::Result<LoadedScene> {
        if bytes == b"broken" {
            bail!("no scene");
        }
        let (load, bvh) = (Duration::from_micros(7), Duration::from_micros(8));
        Ok(LoadedScene {
            scene: Arc::new(*self),
            load,
            bvh,
        })
    }
}

impl Scene for Grey {
    fn set_up(&self, frame: &Frame) -> anyhow::Result<Arc<dyn FrameTasks>> {
        let settings = &frame.settings;
        if !settings.vpls.is_multiple_of(settings.vpl_sets) {
            bail!("the VPLs cannot be divided");
        }
        Ok(Arc::new(GreyFrame {
            pixel: self.pixel,
            settings: settings.clone(),
        }))
    }
}

impl FrameTasks for GreyFrame {
    fn has(&self, task: Task) -> bool {
        task.group < self.settings.groups && task.index < self.settings.spp
    }

    fn render(&self, task: Task, chunks: &mut dyn FnMut(usize) -> usize) -> Output {
        assert!(task.index != BREAKING, "this task is broken");
        let all = self.settings.width * self.settings.height / self.settings.groups;
        let mut output = Output::default();
        let mut radiance = Vec::new();
        while output.pixels < all && chunks(1) > 0 {
            if !self.pixel.is_zero() {
                std::thread::sleep(self.pixel);
            }
            output.pixels += 1;
            radiance.extend([task.group as f32; 3]);
            output.shadow_rays += 1;
        }
        output.radiance = Radiance::pack(&radiance, Encoding::Exact);
        output
    }
}
