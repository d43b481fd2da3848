//! What the protocol costs: a thousand results a second over loopback, as one busy machine sends
//! them, plainly and sealed with a key, against the same bytes through bare sockets. Counts the processor
//! time of both ends.
//!
//! `cargo bench -p protocol`
#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a measurement, for people"
)]

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::thread;
use std::time::Duration;

use protocol::connection::{self, Reader, Writer};
use protocol::envelope::Sealed;
use protocol::message::{Request, TaskResult, ToMaster, ToWorker};
use protocol::radiance::Encoding;
use protocol::{Component, FrameId, Keys, Radiance, Task, envelope, opening};
use tokio::time::{Instant, MissedTickBehavior, interval};

/// Pixels of a group of the paper: 1024 × 768 in 64 groups; 147 kB as RGB.
const PIXELS: u32 = 12_288;
const RESULTS: u32 = 3000;
const PERIOD: Duration = Duration::from_millis(1);
/// Results that follow each other without a pause: 300 MB.
const FLOOD: u32 = 6000;

fn main() {
    let bare = measured(send_bare, receive_bare);
    let plain = measured(send_plain, receive_plain);
    let sealed = measured(send_sealed, receive_sealed);
    let row = |name: &str, micros: f64| {
        let share = micros * 1000.0 / 2e6 * 100.0;
        println!("{name:<14} {micros:6.1} µs per result, {share:4.1} % of two cores at 1000 results/s");
    };
    let megabytes = both().len() as f64 / 1e6;
    row("bare sockets", bare);
    row("the protocol", plain);
    row("with a key", sealed);
    println!(
        "{:<14} {:6.2}, with a key {:.2}",
        "ratio",
        plain / bare,
        sealed / bare
    );
    println!(
        "{:<14} {:6.0} MB/s for sealing and opening",
        "one core",
        megabytes * 1e6 / (sealed - plain)
    );
    // In turn, so that neither has the better second.
    let rates = [false, true, false, true].map(flooded);
    let best = |a: f64, b: f64| a.max(b) / 1e6;
    println!(
        "{:<14} {:6.0} MB/s by the clock, with a key {:.0}",
        "flat out",
        best(rates[0], rates[2]),
        best(rates[1], rates[3])
    );
}

/// Processor time per result of sender and receiver together, in microseconds.
fn measured(send: fn(TcpStream), receive: fn(TcpStream)) -> f64 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let sender = thread::spawn(move || busy(|| send(TcpStream::connect(address).unwrap())));
    let receiver = thread::spawn(move || busy(|| receive(listener.accept().unwrap().0)));
    (sender.join().unwrap() + receiver.join().unwrap()) * 1e6 / f64::from(RESULTS)
}

/// Processor time of this thread while it works, in seconds.
fn busy(work: impl FnOnce()) -> f64 {
    let now = || {
        let times = fs::read_to_string("/proc/thread-self/schedstat").unwrap();
        times.split(' ').next().unwrap().parse::<f64>().unwrap() / 1e9
    };
    let begun = now();
    work();
    now() - begun
}

fn result(group: u32) -> ToMaster {
    ToMaster::Result(TaskResult {
        frame: FrameId(1),
        task: Task {
            component: Component::Indirect,
            group,
            index: 3,
            passes: 1,
        },
        pixels: PIXELS,
        radiance: Radiance::pack(&vec![0.25; 3 * PIXELS as usize], Encoding::SharedExponent),
        primary_rays: 0,
        shadow_rays: u64::from(PIXELS) * 16,
        busy_us: 10_000,
    })
}

fn request() -> ToMaster {
    ToMaster::Request(Request {
        frame: FrameId(1),
        tasks: 1,
    })
}

fn in_runtime(work: impl Future<Output = ()>) {
    tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap()
        .block_on(work);
}

async fn paced(mut each: impl AsyncFnMut(u32)) {
    let mut clock = interval(PERIOD);
    clock.set_missed_tick_behavior(MissedTickBehavior::Burst);
    for number in 0..RESULTS {
        clock.tick().await;
        each(number).await;
    }
}

fn send_plain(stream: TcpStream) {
    in_runtime(async {
        let (_reader, writer) = connection::open::<ToWorker, _>(nonblocking(stream)).unwrap();
        send_messages(writer).await;
    });
}

fn receive_plain(stream: TcpStream) {
    in_runtime(async {
        let (reader, _writer) = connection::open::<_, ToWorker>(nonblocking(stream)).unwrap();
        receive_messages(reader).await;
    });
}

fn send_sealed(stream: TcpStream) {
    in_runtime(async {
        let key = keys().iter().next().unwrap().clone();
        let (_reader, writer) = opening::call(nonblocking(stream), &key).await.unwrap();
        send_messages(writer).await;
    });
}

fn receive_sealed(stream: TcpStream) {
    in_runtime(async {
        let (incoming, outgoing) = nonblocking(stream).into_split();
        let answered = opening::answer(incoming, outgoing, Some(&keys())).await;
        let (reader, _writer) = answered.unwrap().unwrap();
        receive_messages(reader).await;
    });
}

/// Bytes per second by the clock when results, encoded beforehand, follow each other without a pause.
fn flooded(with_key: bool) -> f64 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let message = Sealed::new(&result(0)).unwrap();
    let bytes = message.bytes().len() as f64 * f64::from(FLOOD);
    let sender = thread::spawn(move || {
        in_runtime(async {
            let stream = nonblocking(TcpStream::connect(address).unwrap());
            let (_reader, mut writer) = if with_key {
                let key = keys().iter().next().unwrap().clone();
                opening::call(stream, &key).await.unwrap()
            } else {
                connection::open::<ToWorker, ToMaster>(stream).unwrap()
            };
            for _ in 0..FLOOD {
                writer.push_sealed(message.clone());
                writer.flush().await.unwrap();
            }
        });
    });
    let mut seconds = 0.0;
    in_runtime(async {
        let (incoming, outgoing) = nonblocking(listener.accept().unwrap().0).into_split();
        let keys = with_key.then(keys);
        let answered = opening::answer(incoming, outgoing, keys.as_ref()).await;
        let (mut reader, _writer) = answered.unwrap().unwrap();
        reader.handshake_done();
        let begun = Instant::now();
        let mut results = 0;
        while reader.read().await.unwrap().is_some() {
            results += 1;
        }
        assert_eq!(results, FLOOD);
        seconds = begun.elapsed().as_secs_f64();
    });
    sender.join().unwrap();
    bytes / seconds
}

fn keys() -> Keys {
    Keys::parse(&format!("gridlight-key-1:{}", "5".repeat(64))).unwrap()
}

fn nonblocking(stream: TcpStream) -> tokio::net::TcpStream {
    stream.set_nonblocking(true).unwrap();
    tokio::net::TcpStream::from_std(stream).unwrap()
}

async fn send_messages(mut writer: Writer<ToMaster>) {
    paced(async |number| {
        // The renderer makes the values either way; only what follows is the protocol's.
        writer.push(&result(number)).unwrap();
        writer.push(&request()).unwrap();
        writer.flush().await.unwrap();
    })
    .await;
}

async fn receive_messages(mut reader: Reader<ToMaster>) {
    reader.handshake_done();
    let mut light = 0.0;
    while let Some(message) = reader.read().await.unwrap() {
        if let ToMaster::Result(result) = message {
            light += result.radiance.unpack()[7];
        }
    }
    assert!((light - 0.25 * RESULTS as f32).abs() < 1e-3);
}

/// Bytes of what [`send_messages`] sends at a time.
fn both() -> Vec<u8> {
    [result(0), request()]
        .map(|message| envelope::encode(&message).unwrap())
        .concat()
}

fn send_bare(mut stream: TcpStream) {
    in_runtime(async {
        stream.set_nodelay(true).unwrap();
        let bytes = both();
        paced(async |number| {
            // The renderer's own work, done by the other sender too.
            std::hint::black_box(result(number));
            stream.write_all(&bytes).unwrap();
        })
        .await;
    });
}

fn receive_bare(mut stream: TcpStream) {
    let mut bytes = both();
    for _ in 0..RESULTS {
        stream.read_exact(&mut bytes).unwrap();
    }
}
