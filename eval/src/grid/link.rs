//! The network by model: a delay, and one link into the master that all results share.

use std::time::Duration;

use super::parameters::Network;

/// Bytes of a result besides its pixels.
const ENVELOPE_BYTES: f64 = 128.0;

/// The master's link: what is sent to it arrives one after the other.
#[derive(Debug)]
pub(super) struct Link {
    latency: Duration,
    seconds_per_byte: f64,
    free_at: Duration,
}

impl Link {
    pub(super) fn new(network: &Network) -> Self {
        Self {
            latency: network.latency(),
            seconds_per_byte: network.bandwidth_bytes_per_s.recip(),
            free_at: Duration::ZERO,
        }
    }

    /// When something sent to the master now has arrived.
    pub(super) fn arrival_at_master(&mut self, now: Duration, payload_bytes: usize) -> Duration {
        let duration = (payload_bytes as f64 + ENVELOPE_BYTES) * self.seconds_per_byte;
        self.free_at = self.free_at.max(now + self.latency) + Duration::from_secs_f64(duration);
        self.free_at
    }

    /// When something sent by the master now has arrived; tasks are a few bytes.
    pub(super) fn arrival_at_worker(&self, now: Duration) -> Duration {
        now + self.latency
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_that_are_sent_at_once_arrive_one_after_the_other() {
        let mut link = Link::new(&Network {
            latency_s: 0.5,
            bandwidth_bytes_per_s: 1_000.0,
            delta_t_s: 0.0,
        });
        let payload = 1_000 - ENVELOPE_BYTES as usize;
        let now = Duration::from_secs(1);
        let arrivals = [0; 3].map(|_| link.arrival_at_master(now, payload));
        assert_eq!(arrivals, [2_500, 3_500, 4_500].map(Duration::from_millis));
        // After a pause only latency and its own bytes count.
        assert_eq!(
            link.arrival_at_master(Duration::from_secs(10), payload),
            Duration::from_millis(11_500)
        );
    }
}
