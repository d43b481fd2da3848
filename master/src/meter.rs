//! Measures how fast bytes come in, without asking the other side.

use std::{
    io,
    pin::Pin,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    task::{Context, Poll, ready},
    time::Duration,
};

use tokio::io::{AsyncRead, ReadBuf};

use crate::{clock::Clock, frame_time::FrameTime};

/// Bytes that come within so short a time of those before them were sent with them.
const PAUSE: Duration = Duration::from_millis(2);
/// Fewer bytes in a row tell nothing: they may have waited in a buffer of the system.
const ROW_BYTES_MIN: u64 = 64 << 10;

/// The highest rate at which a row of bytes came in, shared between a connection and the frame.
#[derive(Debug, Clone, Default)]
pub struct Throughput(Arc<AtomicU64>);

impl Throughput {
    /// In bytes per second; 0 if nothing was measured.
    pub fn bytes_per_second(&self) -> f64 {
        self.0.load(Ordering::Relaxed) as f64
    }

    /// So much came in so short a time.
    pub fn saw(&self, bytes: u64, duration: Duration) {
        let rate = bytes as f64 / duration.as_secs_f64().max(1e-6);
        self.0.fetch_max(rate as u64, Ordering::Relaxed);
    }
}

/// A stream whose bytes are counted as they are read.
#[derive(Debug)]
pub struct Metered<S> {
    stream: S,
    clock: Clock,
    row: Row,
    throughput: Throughput,
}

impl<S> Metered<S> {
    /// Measures what is read from this stream.
    pub fn new(stream: S, clock: Clock, throughput: Throughput) -> Self {
        Self {
            stream,
            clock,
            row: Row::default(),
            throughput,
        }
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Metered<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        ready!(Pin::new(&mut self.stream).poll_read(context, buffer))?;
        let bytes = (buffer.filled().len() - before) as u64;
        let now = self.clock.now();
        if let Some((bytes, duration)) = self.row.add(now, bytes) {
            self.throughput.saw(bytes, duration);
        }
        Poll::Ready(Ok(()))
    }
}

/// Bytes that came one after the other.
#[derive(Debug, Default)]
struct Row {
    begin: FrameTime,
    last: FrameTime,
    /// Those after the first piece, of which nobody knows how long it took.
    bytes: u64,
}

impl Row {
    /// Takes a piece; returns how much came how fast, once that tells something.
    fn add(&mut self, now: FrameTime, bytes: u64) -> Option<(u64, Duration)> {
        if self.last.until(now) > PAUSE {
            self.begin = now;
            self.bytes = 0;
        } else {
            self.bytes += bytes;
        }
        self.last = now;
        (self.bytes >= ROW_BYTES_MIN).then(|| (self.bytes, self.begin.until(now)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(microseconds: u64) -> FrameTime {
        FrameTime::after_start(Duration::from_micros(microseconds))
    }

    #[test]
    fn a_row_of_pieces_tells_the_rate_of_all_but_the_first() {
        let mut row = Row::default();
        assert_eq!(row.add(at(10_000), 40_000), None);
        assert_eq!(row.add(at(10_400), 50_000), None);
        assert_eq!(
            row.add(at(10_800), 50_000),
            Some((100_000, Duration::from_micros(800)))
        );
    }

    #[test]
    fn a_pause_begins_a_new_row() {
        let mut row = Row::default();
        row.add(at(10_000), 40_000);
        row.add(at(10_400), 60_000);
        assert_eq!(row.add(at(20_000), 60_000), None);
        assert_eq!(row.add(at(20_100), 60_000), None);
    }
}
