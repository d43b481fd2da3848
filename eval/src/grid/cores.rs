//! One core of the grid: a worker that renders one task at a time, at its own speed.

use std::{collections::VecDeque, time::Duration};

use render::task::Task;

use super::{parameters::Grid, simulate::TaskCost};

/// A worker with one slot.
#[derive(Debug)]
pub(super) struct Core {
    rays_per_s: f64,
    task_overhead_s: f64,
    pixel_overhead_s: f64,
    present: bool,
    busy: bool,
    tasks: VecDeque<Task>,
    send_by: Option<Duration>,
}

/// How a task that begins now will end, if its core stays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ending {
    pub(super) at: Duration,
    pub(super) task: Task,
    /// Length of the finished beginning of the task's group.
    pub(super) pixels: u32,
}

impl Core {
    /// `number` counts all cores there ever were.
    pub(super) fn new(grid: &Grid, rays_per_s: f64, number: u32) -> Self {
        let deviation = 2.0 * draw(grid.seed, number, Purpose::Speed) - 1.0;
        Self {
            rays_per_s: rays_per_s * (1.0 + grid.speed_spread * deviation),
            task_overhead_s: grid.task_overhead_s,
            pixel_overhead_s: grid.pixel_overhead_s,
            present: true,
            busy: false,
            tasks: VecDeque::new(),
            send_by: None,
        }
    }

    pub(super) fn is_present(&self) -> bool {
        self.present
    }

    pub(super) fn leave(&mut self) {
        self.present = false;
    }

    pub(super) fn set_send_by(&mut self, at: Duration) {
        self.send_by = Some(at);
    }

    pub(super) fn take(&mut self, tasks: Vec<Task>) {
        self.tasks.extend(tasks);
    }

    /// Whether a task ended; the next may begin.
    pub(super) fn rest(&mut self) {
        self.busy = false;
    }

    /// Begins the next task if the core is idle and has one.
    pub(super) fn begin(&mut self, now: Duration, cost: impl Fn(Task) -> TaskCost) -> Option<Ending> {
        if self.busy || !self.present {
            return None;
        }
        let task = self.tasks.pop_front()?;
        self.busy = true;
        let cost = cost(task);
        let pixels = f64::from(cost.pixels);
        let pixel_s = cost.rays as f64 / self.rays_per_s / pixels.max(1.0) + self.pixel_overhead_s;
        let done = now + Duration::from_secs_f64(self.task_overhead_s + pixel_s * pixels);
        Some(match self.send_by {
            Some(send_by) if send_by < done => {
                let at = send_by.max(now);
                let rendering_s = at.saturating_sub(now).as_secs_f64() - self.task_overhead_s;
                let chunks = rendering_s.max(0.0) / (pixel_s * f64::from(cost.chunk_pixels));
                Ending {
                    at,
                    task,
                    pixels: (chunks as u32 * cost.chunk_pixels).min(cost.pixels),
                }
            }
            _ => Ending {
                at: done,
                task,
                pixels: cost.pixels,
            },
        })
    }
}

/// The moments, in seconds, at which the first `count` cores ask for their first tasks: evenly spread,
/// in an order drawn by lot.
pub(super) fn first_requests(grid: &Grid, count: u32) -> Vec<f64> {
    let [first, last] = grid.first_request_s;
    let mut order: Vec<u32> = (0..count).collect();
    order.sort_by(|&a, &b| {
        let lot = |core| draw(grid.seed, core, Purpose::FirstRequest);
        lot(a).total_cmp(&lot(b))
    });
    let mut moments = vec![0.0; order.len()];
    for (rank, core) in order.into_iter().enumerate() {
        let share = (rank as f64 + 0.5) / f64::from(count);
        moments[core as usize] = first + (last - first) * share;
    }
    moments
}

#[derive(Debug, Clone, Copy)]
enum Purpose {
    Speed = 1,
    FirstRequest = 2,
}

/// A number in 0..1 that depends on nothing but its arguments (the finalizer of `SplitMix64`).
fn draw(seed: u64, core: u32, purpose: Purpose) -> f64 {
    let mut bits = seed ^ (u64::from(core) << 8 | purpose as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ bits >> 31) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use render::task::Component;

    use super::*;
    use crate::grid::parameters::Parameters;

    const TASK: Task = Task {
        component: Component::Direct,
        group: 0,
        index: 0,
        passes: 1,
    };
    const COST: TaskCost = TaskCost {
        pixels: 100,
        chunk_pixels: 10,
        rays: 1_000,
        floats_per_pixel: 3,
    };

    /// One second of overhead, ten of rays.
    fn core(send_by_s: Option<f64>) -> Core {
        let grid = Grid {
            speed_spread: 0.0,
            task_overhead_s: 1.0,
            pixel_overhead_s: 0.0,
            ..Parameters::load(None).unwrap().grid
        };
        let mut core = Core::new(&grid, 100.0, 0);
        if let Some(send_by_s) = send_by_s {
            core.set_send_by(Duration::from_secs_f64(send_by_s));
        }
        core.take(vec![TASK, TASK]);
        core
    }

    fn ending(send_by_s: Option<f64>) -> (f64, u32) {
        let ending = core(send_by_s).begin(Duration::from_secs(5), |_| COST).unwrap();
        (ending.at.as_secs_f64(), ending.pixels)
    }

    #[test]
    fn a_task_takes_its_rays_at_the_cores_speed_and_an_overhead() {
        assert_eq!(ending(None), (16.0, 100));
        assert_eq!(ending(Some(20.0)), (16.0, 100));
    }

    #[test]
    fn a_task_that_is_stopped_yields_whole_chunks() {
        assert_eq!(ending(Some(8.5)), (8.5, 20));
        assert_eq!(ending(Some(5.5)), (5.5, 0));
        assert_eq!(ending(Some(3.0)), (5.0, 0));
    }

    #[test]
    fn a_core_renders_one_task_at_a_time_and_none_when_it_is_gone() {
        let mut core = core(None);
        let now = Duration::ZERO;
        assert!(core.begin(now, |_| COST).is_some());
        assert_eq!(core.begin(now, |_| COST), None);
        core.rest();
        core.leave();
        assert_eq!(core.begin(now, |_| COST), None);
    }

    #[test]
    fn first_requests_are_spread_evenly_and_depend_on_the_seed() {
        let grid = Parameters::load(None).unwrap().grid;
        let [first, last] = grid.first_request_s;
        let moments = first_requests(&grid, 96);
        let mean = moments.iter().sum::<f64>() / 96.0;
        assert!((mean - f64::midpoint(first, last)).abs() < 1e-9);
        assert!(!moments.is_sorted());
        let other = Grid {
            seed: grid.seed + 1,
            ..grid.clone()
        };
        assert_ne!(first_requests(&other, 96), moments);
    }
}
