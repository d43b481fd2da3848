//! Many workers in one process, with results made beforehand: what a master can carry, besides rays.
//!
//! `bench/load/run.py` starts it beside a master. Each worker has its own connection and follows the
//! protocol; a task takes a stated time and no processor.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::net::SocketAddr;
use std::rc::Rc;
use std::time::Duration;

use anyhow::{Context as _, bail, ensure};
use clap::Parser;
use protocol::connection::{Reader, Writer};
use protocol::message::{Hello, Pong, Prepared, Request, TaskResult};
use protocol::{Component, FrameId, Radiance, Task, ToMaster, ToWorker, limits, version};
use tokio::net::TcpStream;
use tokio::task::LocalSet;
use tokio::time::{Instant, sleep_until, timeout};

/// Pretends to be many workers.
#[derive(Clone, Copy, Debug, Parser)]
struct Options {
    /// The master, on this machine
    #[arg(long)]
    connect: SocketAddr,
    /// Connections
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=limits::WORKERS as i64))]
    workers: u32,
    /// Tasks that each works on at a time
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    slots: u32,
    /// Mean time of a task; each takes from half to three halves of it
    #[arg(long, value_name = "MILLISECONDS", default_value_t = 800)]
    task_ms: u32,
    /// It all ends after so long
    #[arg(long, value_name = "SECONDS", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=600))]
    within: u64,
}

/// What all workers saw.
#[derive(Debug, Default)]
struct Seen {
    joined: u32,
    failed: u32,
    results: u64,
    result_bytes: u64,
    /// From a request to the task that answers it, but for those that all workers sent at once.
    waits: Vec<Duration>,
    /// The longest of those.
    begin: Duration,
    first: Option<Instant>,
    last: Option<Instant>,
}

type Shared = Rc<RefCell<Seen>>;

fn main() -> anyhow::Result<()> {
    let options = Options::parse();
    ensure!(
        options.connect.ip().is_loopback(),
        "only a master on this machine may be loaded"
    );
    let seen = Shared::default();
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let all = async {
        let workers = LocalSet::new();
        for number in 0..options.workers {
            let shared = Rc::clone(&seen);
            workers.spawn_local(async move {
                if worker(options, number, &shared).await.is_err() {
                    shared.borrow_mut().failed += 1;
                }
            });
        }
        workers.await;
    };
    // Whoever is not done by then has not failed.
    let _ = runtime.block_on(async { timeout(Duration::from_secs(options.within), all).await });
    report(&mut seen.borrow_mut());
    Ok(())
}

#[expect(clippy::print_stdout, reason = "a measurement, for a script")]
fn report(seen: &mut Seen) {
    seen.waits.sort_unstable();
    let wait_ms = |share: f64| {
        let place = (seen.waits.len() as f64 * share) as usize;
        let wait = seen.waits.get(place.min(seen.waits.len().saturating_sub(1)));
        wait.map_or(0.0, |wait| 1e3 * wait.as_secs_f64())
    };
    let time = match (seen.first, seen.last) {
        (Some(first), Some(last)) => last - first,
        _ => Duration::ZERO,
    };
    println!(
        "{{\"joined\": {}, \"failed\": {}, \"results\": {}, \"result_bytes\": {}, \"seconds\": {:.3}, \"begin_ms\": {:.3}, \
         \"wait_ms\": {{\"p50\": {:.3}, \"p99\": {:.3}, \"max\": {:.3}}}}}",
        seen.joined,
        seen.failed,
        seen.results,
        seen.result_bytes,
        time.as_secs_f64(),
        1e3 * seen.begin.as_secs_f64(),
        wait_ms(0.5),
        wait_ms(0.99),
        wait_ms(1.0),
    );
}

/// One worker while it lives.
struct Worker<'a> {
    options: Options,
    shared: &'a Shared,
    writer: Writer<ToMaster>,
    /// The frame, and the results that its tasks have.
    frame: Option<(FrameId, Light)>,
    /// When each task that was asked for was asked for.
    asked: VecDeque<Instant>,
    /// Tasks that came on the first request.
    begun: u32,
    /// Tasks with the times at which they will be done, in order.
    working: VecDeque<(Instant, Task)>,
}

/// A result of each size.
struct Light {
    pixels: u32,
    one: Radiance,
    both: Radiance,
}

async fn worker(options: Options, number: u32, shared: &Shared) -> anyhow::Result<()> {
    let stream = TcpStream::connect(options.connect).await?;
    let (mut reader, writer) = protocol::connection::open::<ToWorker, ToMaster>(stream)?;
    let mut worker = Worker {
        options,
        shared,
        writer,
        frame: None,
        asked: VecDeque::new(),
        begun: 0,
        working: VecDeque::new(),
    };
    worker.writer.push(&ToMaster::Hello(Hello {
        magic: version::MAGIC.to_owned(),
        protocol: version::PROTOCOL,
        version: "of a load test".to_owned(),
        name: format!("load-{number}"),
        slots: options.slots,
        token: None,
    }))?;
    while worker.step(&mut reader).await? {}
    Ok(())
}

impl Worker<'_> {
    /// Sees to the next thing that happens; false at the end.
    async fn step(&mut self, reader: &mut Reader<ToWorker>) -> anyhow::Result<bool> {
        let done = self.working.front().map(|&(done, _)| done);
        tokio::select! {
            message = reader.read() => match message? {
                Some(ToWorker::Welcome(_)) => {
                    reader.handshake_done();
                    self.shared.borrow_mut().joined += 1;
                }
                Some(ToWorker::Shutdown(_)) | None => return Ok(false),
                Some(message) => self.heard(message)?,
            },
            () = sleep_until(done.unwrap_or_else(now)), if done.is_some() => self.finish()?,
            flushed = self.writer.flush(), if !self.writer.is_empty() => flushed?,
        }
        Ok(true)
    }

    fn heard(&mut self, message: ToWorker) -> anyhow::Result<()> {
        match message {
            ToWorker::Ping(ping) => self.writer.push(&ToMaster::Pong(Pong { nonce: ping.nonce }))?,
            // The scene is of no interest to those who trace nothing.
            ToWorker::Prepare(prepare) => self.writer.push(&ToMaster::Prepared(Prepared {
                digest: prepare.scene.digest,
                load_us: 1,
                bvh_us: 1,
            }))?,
            ToWorker::Frame(frame) => {
                let pixels = frame.settings.width * frame.settings.height / frame.settings.groups;
                let radiance = |component: Component| {
                    let values = pixels as usize * component.floats_per_pixel();
                    let noise =
                        (0..values as u32).map(|place| (place.wrapping_mul(2_654_435_761) >> 8) as f32);
                    Radiance::pack(&noise.collect::<Vec<_>>(), frame.radiance)
                };
                let light = Light {
                    pixels,
                    one: radiance(Component::Direct),
                    both: radiance(Component::Full),
                };
                self.frame = Some((frame.frame, light));
                self.request(self.options.slots)?;
            }
            ToWorker::Assign(assign) => self.begin(&assign.tasks)?,
            ToWorker::EndFrame(_) | ToWorker::CutOff(_) => self.working.clear(),
            ToWorker::Refused(refused) => bail!(refused.reason),
            _ => {}
        }
        Ok(())
    }

    fn request(&mut self, tasks: u32) -> anyhow::Result<()> {
        let (frame, _) = self.frame.as_ref().context("no frame has begun")?;
        self.writer
            .push(&ToMaster::Request(Request { frame: *frame, tasks }))?;
        self.asked.extend((0..tasks).map(|_| now()));
        Ok(())
    }

    fn begin(&mut self, tasks: &[Task]) -> anyhow::Result<()> {
        let now = now();
        let mut seen = self.shared.borrow_mut();
        for &task in tasks {
            let asked = self.asked.pop_front().context("more tasks than were asked for")?;
            if self.begun < self.options.slots {
                self.begun += 1;
                seen.begin = seen.begin.max(now - asked);
            } else {
                seen.waits.push(now - asked);
            }
            seen.first.get_or_insert(now);
            let done = now + self.time_of(task);
            let place = self.working.partition_point(|&(other, _)| other <= done);
            self.working.insert(place, (done, task));
        }
        Ok(())
    }

    /// From half the mean time to three halves of it, so that tasks which began together do not end so.
    fn time_of(&self, task: Task) -> Duration {
        let number = (task.group << 6) ^ task.index ^ (task.component as u32) << 31;
        let chance = f64::from(number.wrapping_mul(2_654_435_761)) / f64::from(u32::MAX);
        Duration::from_millis(self.options.task_ms.into()).mul_f64(0.5 + chance)
    }

    fn finish(&mut self) -> anyhow::Result<()> {
        let (Some((_, task)), Some((frame, light))) = (self.working.pop_front(), &self.frame) else {
            return Ok(());
        };
        let radiance = match task.component {
            Component::Full => &light.both,
            Component::Direct | Component::Indirect => &light.one,
        };
        {
            let mut seen = self.shared.borrow_mut();
            seen.results += 1;
            seen.result_bytes += radiance.bytes() as u64;
            seen.last = Some(now());
        }
        self.writer.push(&ToMaster::Result(TaskResult {
            frame: *frame,
            task,
            pixels: light.pixels,
            radiance: radiance.clone(),
            primary_rays: light.pixels.into(),
            shadow_rays: light.pixels.into(),
            busy_us: 1000 * u64::from(self.options.task_ms),
        }))?;
        self.request(1)
    }
}

fn now() -> Instant {
    Instant::now()
}
