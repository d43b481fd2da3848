//! Whose last results come when: what several workers send over one wire must not come at once.
//!
//! Workers take turns. The one that is first in turn stops last and has the wire for itself just before the
//! cut-off; each of the others stops so much earlier that its bytes are through before the next turn begins.
//! So no result waits behind others, and the light that is given up is half of what it would be if all
//! stopped as early as the earliest.

use std::{collections::BTreeMap, net::IpAddr, time::Duration};

/// What the slowest network we plan for carries: 100 Mbit/s.
const BYTES_PER_SECOND_MIN: f64 = 12.5e6;

/// What one worker will send at the end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flush {
    /// Its machine. All workers of one share its wire, and all machines but this one share ours.
    pub host: IpAddr,
    /// Results of all its slots.
    pub bytes: f64,
    /// The fastest that anything came from it; 0 if nothing was measured.
    pub bytes_per_second: f64,
}

/// How long before the last moment each worker's first byte must be on its way, in the same order.
pub fn lead_times(flushes: &[Flush]) -> Vec<Duration> {
    let mut hosts: BTreeMap<IpAddr, Wire> = BTreeMap::new();
    let mut ours = Wire::default();
    for flush in flushes {
        hosts.entry(flush.host).or_default().measured(flush);
        if !flush.host.is_loopback() {
            // The fastest sender tells what our own wire carries at least.
            ours.measured(flush);
        }
    }
    let lead_times = flushes.iter().map(|flush| {
        let from_host = hosts.entry(flush.host).or_default().queue(flush.bytes);
        if flush.host.is_loopback() {
            from_host
        } else {
            from_host.max(ours.queue(flush.bytes))
        }
    });
    lead_times.collect()
}

/// How long one result of every slot is on the way, in the same order, if all share their wires evenly: as long as
/// those of everyone on the wire that is shared by more bytes for its speed.
pub fn times_on_the_wire(flushes: &[Flush]) -> Vec<Duration> {
    let mut hosts: BTreeMap<IpAddr, Wire> = BTreeMap::new();
    let mut ours = Wire::default();
    for flush in flushes {
        let host = hosts.entry(flush.host).or_default();
        for wire in [Some(host), (!flush.host.is_loopback()).then_some(&mut ours)]
            .into_iter()
            .flatten()
        {
            wire.measured(flush);
            wire.queued_bytes += flush.bytes;
        }
    }
    let times = flushes.iter().map(|flush| {
        let from_host = hosts.entry(flush.host).or_default().time();
        if flush.host.is_loopback() {
            from_host
        } else {
            from_host.max(ours.time())
        }
    });
    times.collect()
}

/// A wire that carries one worker's bytes after the other.
#[derive(Debug, Default)]
struct Wire {
    bytes_per_second: f64,
    queued_bytes: f64,
}

impl Wire {
    fn measured(&mut self, flush: &Flush) {
        self.bytes_per_second = self.bytes_per_second.max(flush.bytes_per_second);
    }

    /// The time until these bytes are through, with all before them.
    fn queue(&mut self, bytes: f64) -> Duration {
        self.queued_bytes += bytes;
        self.time()
    }

    /// The time until all bytes are through.
    fn time(&self) -> Duration {
        Duration::from_secs_f64(self.queued_bytes / self.bytes_per_second.max(BYTES_PER_SECOND_MIN))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 125 kB: a millisecond of 1 Gbit/s.
    fn flush(host: &str, megabytes_per_second: f64) -> Flush {
        Flush {
            host: host.parse().unwrap(),
            bytes: 125e3,
            bytes_per_second: 1e6 * megabytes_per_second,
        }
    }

    fn lead_ms(flushes: &[Flush]) -> Vec<u128> {
        lead_times(flushes).iter().map(Duration::as_millis).collect()
    }

    #[test]
    fn a_worker_alone_needs_the_time_of_its_own_bytes() {
        assert_eq!(lead_ms(&[flush("10.0.0.1", 125.0)]), [1]);
    }

    #[test]
    fn workers_of_one_machine_take_turns_on_its_wire() {
        let machine = [
            flush("10.0.0.1", 125.0),
            flush("10.0.0.1", 20.0),
            flush("10.0.0.1", 0.0),
        ];
        assert_eq!(lead_ms(&machine), [1, 2, 3]);
    }

    #[test]
    fn machines_take_turns_on_the_wire_of_the_master() {
        let hosts = ["10.0.0.1", "10.0.0.2", "10.0.0.3"].map(|host| flush(host, 125.0));
        assert_eq!(lead_ms(&hosts), [1, 2, 3]);
    }

    /// The paper's 96 cores at 49 kB each, in one room with 1 Gbit/s.
    #[test]
    fn ninety_six_cores_are_through_in_forty_milliseconds() {
        let flushes: Vec<Flush> = (1..=24)
            .map(|host| Flush {
                bytes: 4.0 * 49_152.0,
                ..flush(&format!("10.0.0.{host}"), 125.0)
            })
            .collect();
        assert_eq!(lead_ms(&flushes).last(), Some(&37));
    }

    #[test]
    fn a_slow_machine_needs_longer_but_does_not_hold_up_the_others() {
        let hosts = [flush("10.0.0.1", 12.5), flush("10.0.0.2", 125.0)];
        assert_eq!(lead_ms(&hosts), [10, 2]);
    }

    #[test]
    fn workers_on_this_machine_do_not_use_the_wire() {
        let hosts = [
            flush("127.0.0.1", 1250.0),
            flush("10.0.0.1", 125.0),
            flush("::1", 1250.0),
        ];
        assert_eq!(lead_ms(&hosts), [0, 1, 0]);
    }

    #[test]
    fn results_share_the_wire_of_their_machine_and_that_of_the_master() {
        let times_ms = |flushes: &[Flush]| -> Vec<u128> {
            times_on_the_wire(flushes)
                .iter()
                .map(Duration::as_millis)
                .collect()
        };
        let slow_and_fast = [
            flush("10.0.0.1", 12.5),
            flush("10.0.0.2", 125.0),
            flush("127.0.0.1", 1250.0),
        ];
        assert_eq!(times_ms(&slow_and_fast), [10, 2, 0]);
        let one_machine = [125.0, 0.0, 20.0].map(|rate| flush("10.0.0.1", rate));
        assert_eq!(times_ms(&one_machine), [3, 3, 3]);
        let room: Vec<Flush> = (1..=24)
            .map(|host| flush(&format!("10.0.0.{host}"), 125.0))
            .collect();
        assert_eq!(times_ms(&room), [24; 24]);
    }

    #[test]
    fn what_was_never_measured_is_taken_for_100_mbit() {
        assert_eq!(lead_ms(&[flush("10.0.0.1", 0.0)]), [10]);
    }
}
