//! What pulling tasks over the network costs the slots: the same work done by bare threads and by a
//! worker whose master is at the other end of a loopback connection, in turn.
//!
//! `cargo bench -p worker`
#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a measurement, for people"
)]

use std::fs;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::Duration;

use protocol::message::{Assign, Frame as FrameMessage, Prepare, SceneChunk, SceneRef, Shutdown, Welcome};
use protocol::radiance::Encoding;
use protocol::settings::{Algorithm, LightPoints, Settings};
use protocol::{Component, FrameId, Radiance, Task, ToMaster, ToWorker, WorkerId, connection};
use tokio::net::TcpListener;
use worker::clock::Clock;
use worker::renderer::{Frame, LoadedScene, Output, Renderer, Scene};
use worker::{Lifetime, Priority, WorkerOptions};

const SLOTS: u32 = 2;
const ROUNDS: usize = 5;
/// Pixels of a group of the paper: 147 kB a result.
const PIXELS: u32 = 12_288;

/// Rounds of arithmetic per value and tasks: about a millisecond a task, as one light sample of a
/// group takes, and ten times that, as a VPL set takes.
const WORKS: [Work; 2] = [
    Work {
        name: "short",
        effort: 5,
        tasks: 1000,
    },
    Work {
        name: "long",
        effort: 50,
        tasks: 100,
    },
];

#[derive(Clone, Copy, Debug)]
struct Work {
    name: &'static str,
    effort: u32,
    tasks: u32,
}

/// What some work took.
#[derive(Clone, Copy)]
struct Time {
    /// From begin to end.
    wall: Duration,
    /// Of all threads together: master, worker and slots.
    processor: Duration,
}

fn main() {
    for work in WORKS {
        // Other programs only ever make it slower, so the best round says most.
        let best = |way: fn(Work) -> Duration| {
            let rounds: Vec<Time> = (0..ROUNDS).map(|_| timed(way, work)).collect();
            let wall = rounds.iter().map(|time| time.wall).min().unwrap();
            let processor = rounds.iter().map(|time| time.processor).min().unwrap();
            Time { wall, processor }
        };
        let (bare, pulled) = (best(bare), best(pulled));
        let percent = |bare: Duration, pulled: Duration| 100.0 * bare.as_secs_f64() / pulled.as_secs_f64();
        println!(
            "{} tasks of {:.2?}: a worker and its master reach {:.1} % of bare threads by the clock, \
             {:.1} % by processor time",
            work.name,
            bare.processor / work.tasks,
            percent(bare.wall, pulled.wall),
            percent(bare.processor, pulled.processor),
        );
    }
}

fn timed(way: fn(Work) -> Duration, work: Work) -> Time {
    let before = processor_time();
    let wall = way(work);
    Time {
        wall,
        processor: processor_time().saturating_sub(before),
    }
}

/// Processor time of this process so far; the system tells it in hundredths of a second.
fn processor_time() -> Duration {
    let status = fs::read_to_string("/proc/self/stat").unwrap();
    let fields = status.rsplit_once(')').unwrap().1.split_whitespace();
    // Fields 14 and 15 of the whole line: in user and in system mode.
    let ticks: u64 = fields
        .skip(11)
        .take(2)
        .map(|field| field.parse::<u64>().unwrap())
        .sum();
    Duration::from_millis(10 * ticks)
}

/// A task's light, at a price; the same machine code for both ways.
#[inline(never)]
fn shine(effort: u32) -> Vec<f32> {
    let value = |index: u32| (0..effort).fold(index as f32, |light, _| (light + 1.0).sqrt() * 1.5);
    (0..3 * PIXELS).map(value).collect()
}

/// Threads with nothing between them but a counter.
fn bare(work: Work) -> Duration {
    let clock = Clock::start();
    let next = AtomicU32::new(0);
    thread::scope(|scope| {
        for _ in 0..SLOTS {
            scope.spawn(|| {
                while next.fetch_add(1, Ordering::Relaxed) < work.tasks {
                    std::hint::black_box(shine(work.effort));
                }
            });
        }
    });
    clock.now()
}

/// A worker and its master, from the first request to the last result.
fn pulled(work: Work) -> Duration {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    runtime.block_on(async {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let options = WorkerOptions {
            connect: listener.local_addr().unwrap().to_string(),
            keys: None,
            slots: SLOTS,
            name: "bench".to_owned(),
            policy: None,
            priority: Priority::Ordinary,
            memory_max: u64::MAX,
            lifetime: Lifetime::OneMaster { token: None },
            cache: None,
            version: "bench".to_owned(),
        };
        let renderer = Box::new(Shining(work.effort));
        let worker = thread::spawn(move || worker::run_with(options, Clock::start(), renderer));
        let time = serve(&listener, work.tasks).await;
        worker.join().unwrap().unwrap();
        time
    })
}

/// Of no interest to this renderer.
const SCENE: &[u8] = b"scene";

async fn serve(listener: &TcpListener, total: u32) -> Duration {
    let (stream, _) = listener.accept().await.unwrap();
    let (mut reader, mut writer) = connection::open::<ToMaster, ToWorker>(stream).unwrap();
    reader.handshake_done();
    let scene = SceneRef::of(SCENE);
    let frame = FrameMessage {
        frame: FrameId(1),
        settings: settings(),
        vpl_sets: Vec::new(),
        radiance: Encoding::Exact,
    };
    for message in [
        ToWorker::Welcome(Welcome {
            worker: WorkerId(1),
            version: "bench".to_owned(),
        }),
        ToWorker::Prepare(Prepare { scene }),
        ToWorker::Frame(frame),
    ] {
        writer.send(&message).await.unwrap();
    }

    let (mut issued, mut results, mut clock) = (0, 0, Clock::start());
    while results < total {
        match reader.read().await.unwrap().unwrap() {
            ToMaster::Want(want) => {
                let chunk = SceneChunk {
                    digest: want.digest,
                    chunk: want.chunk,
                    data: SCENE.to_vec().into(),
                };
                writer.send(&ToWorker::SceneChunk(chunk)).await.unwrap();
            }
            ToMaster::Request(request) => {
                if issued == 0 {
                    clock = Clock::start();
                }
                let count = request.tasks.min(total - issued);
                let task = |group| Task {
                    component: Component::Direct,
                    group,
                    index: 0,
                    passes: 1,
                };
                let tasks = (issued..issued + count).map(task).collect();
                issued += count;
                let assign = Assign {
                    frame: FrameId(1),
                    tasks,
                    send_within_us: Some(60_000_000),
                };
                writer.send(&ToWorker::Assign(assign)).await.unwrap();
            }
            ToMaster::Result(_) => results += 1,
            _ => {}
        }
    }
    let time = clock.now();
    writer.send(&ToWorker::Shutdown(Shutdown {})).await.unwrap();
    time
}

fn settings() -> Settings {
    Settings {
        algorithm: Algorithm::Component,
        width: 1024,
        height: 768,
        groups: 64,
        spp: 16,
        vpls: 256,
        vpl_sets: 16,
        seed: 1,
        geometry_clamp: None,
        light_points: LightPoints::PerPass,
    }
}

#[derive(Clone, Copy, Debug)]
struct Shining(u32);

impl Renderer for Shining {
    fn load(&self, _: &[u8]) -> anyhow::Result<LoadedScene> {
        let (load, bvh) = (Duration::ZERO, Duration::ZERO);
        Ok(LoadedScene {
            scene: Arc::new(*self),
            load,
            bvh,
        })
    }
}

impl Scene for Shining {
    fn set_up(&self, _: &FrameMessage) -> anyhow::Result<Arc<dyn Frame>> {
        Ok(Arc::new(*self))
    }
}

impl Frame for Shining {
    fn has(&self, _: Task) -> bool {
        true
    }

    fn render(&self, _: Task, _: &mut dyn FnMut(usize) -> usize) -> Output {
        Output {
            pixels: PIXELS,
            radiance: Radiance::pack(&shine(self.0), Encoding::Exact),
            primary_rays: 0,
            shadow_rays: 0,
        }
    }
}
