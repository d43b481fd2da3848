//! How long a worker's last results take to come: the paper's Δt, estimated with every message.
//!
//! Δt = a round trip + one chunk of rays + the time until its last results are through, which
//! [`flush`](crate::flush) finds from those of everyone.
//! A *whole* round trip: the worker counts its time from when it reads the message, which is one way
//! late, and the results take the other way. Round trips are taken near their largest: pongs wait
//! behind pixels and behind other programs exactly as results do.

use std::{collections::VecDeque, net::IpAddr, time::Duration};

use crate::{flush::Flush, meter::Throughput};

/// Measurements that are remembered of each kind.
const RECENT: usize = 32;
/// The share of the remembered measurements that may be larger than the estimate.
const TAIL_DIVISOR: usize = 16;
/// Assumed until something is measured.
const ROUND_TRIP_UNKNOWN: Duration = Duration::from_millis(4);
/// As in the largest task of the paper's settings.
const CHUNK_UNKNOWN: Duration = Duration::from_millis(2);

/// What is known of the way to one worker.
#[derive(Debug, Clone)]
pub struct Link {
    round_trips: Recent,
    chunks: Recent,
    result_bytes: f64,
    throughput: Throughput,
}

impl Link {
    /// A way whose bytes are metered.
    pub fn new(throughput: Throughput) -> Self {
        Self {
            round_trips: Recent::default(),
            chunks: Recent::default(),
            result_bytes: 0.0,
            throughput,
        }
    }

    /// A ping was answered.
    pub fn round_trip(&mut self, duration: Duration) {
        self.round_trips.push(duration);
    }

    /// A result came: this many bytes, from this many chunks that took a slot this long.
    pub fn result(&mut self, bytes: usize, chunks: u32, busy: Duration) {
        if chunks > 0 {
            self.chunks.push(busy / chunks);
        }
        self.result_bytes = self.result_bytes.max(bytes as f64);
    }

    /// What a worker with so many slots sends at the end.
    pub fn flush(&self, host: IpAddr, slots: u32) -> Flush {
        Flush {
            host,
            bytes: self.result_bytes * f64::from(slots),
            bytes_per_second: self.throughput.bytes_per_second(),
        }
    }

    /// How long before the cut-off the worker must stop, if its results need so long until they are through.
    pub fn delta_t(&self, flush: Duration) -> Duration {
        self.round_trips.high().unwrap_or(ROUND_TRIP_UNKNOWN)
            + self.chunks.high().unwrap_or(CHUNK_UNKNOWN)
            + flush
    }
}

/// The last measurements of a duration.
#[derive(Debug, Clone, Default)]
pub struct Recent {
    durations: VecDeque<Duration>,
}

impl Recent {
    /// Remembers one, and forgets the oldest.
    pub fn push(&mut self, duration: Duration) {
        if self.durations.len() == RECENT {
            self.durations.pop_front();
        }
        self.durations.push_back(duration);
    }

    /// A duration that few are above: the largest but for one in sixteen.
    pub fn high(&self) -> Option<Duration> {
        let mut sorted: Vec<Duration> = self.durations.iter().copied().collect();
        sorted.sort_unstable();
        let above = sorted.len() / TAIL_DIVISOR;
        sorted.into_iter().rev().nth(above)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    #[test]
    fn delta_t_adds_the_round_trip_a_chunk_and_the_time_until_the_last_results_are_through() {
        let mut link = Link::new(Throughput::default());
        link.round_trip(ms(2));
        link.result(125_000, 10, ms(30));
        assert_eq!(link.delta_t(ms(4)), ms(2 + 3 + 4));
    }

    #[test]
    fn at_the_end_every_slot_sends_a_result() {
        let throughput = Throughput::default();
        throughput.saw(125_000, ms(1));
        let mut link = Link::new(throughput);
        link.result(125_000, 10, ms(30));
        link.result(90_000, 7, ms(20));
        let host = IpAddr::from([10, 0, 0, 1]);
        let expected = Flush {
            host,
            bytes: 500e3,
            bytes_per_second: 125e6,
        };
        assert_eq!(link.flush(host, 4), expected);
    }

    #[test]
    fn a_single_hiccup_among_many_round_trips_does_not_count() {
        let mut link = Link::new(Throughput::default());
        link.result(0, 1, ms(0));
        for _ in 0..31 {
            link.round_trip(ms(1));
        }
        link.round_trip(ms(500));
        assert_eq!(link.delta_t(ms(0)), ms(1));
    }

    #[test]
    fn a_way_that_has_become_slow_is_believed_after_a_few_measurements() {
        let mut link = Link::new(Throughput::default());
        link.result(0, 1, ms(0));
        for milliseconds in [1, 1, 1, 1, 40, 40, 40] {
            link.round_trip(ms(milliseconds));
        }
        assert_eq!(link.delta_t(ms(0)), ms(40));
    }
}
