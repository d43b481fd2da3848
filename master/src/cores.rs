//! Threads for the finish phase, one on each core.
//!
//! Threads that wake each other are put on the same core by Linux, unless another one is idle; it takes
//! a tenth of a second until they are spread out again, which is as long as the whole finish phase. So
//! each of these threads stays on a core of its own. On a busy machine that halves the finish phase.

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// Starts the threads; they sleep until they are needed.
pub fn pool() -> Result<ThreadPool, ThreadPoolBuildError> {
    let cores = allowed();
    ThreadPoolBuilder::new()
        .num_threads(cores.len())
        .thread_name(|index| format!("finish {index}"))
        .start_handler(move |index| {
            if let Some(core) = cores.get(index) {
                stay_on(*core);
            }
        })
        .build()
}

/// The cores that this process may use.
fn allowed() -> Vec<usize> {
    match sched_getaffinity(None) {
        Ok(set) => (0..CpuSet::MAX_CPU).filter(|&core| set.is_set(core)).collect(),
        // As many threads as the standard library thinks right, wherever the system puts them.
        Err(_) => Vec::new(),
    }
}

fn stay_on(core: usize) {
    let mut set = CpuSet::new();
    set.set(core);
    if let Err(error) = sched_setaffinity(None, &set) {
        tracing::debug!(%error, core, "a thread cannot be kept on its core");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_thread_has_a_core_of_its_own() {
        let homes = pool().unwrap().broadcast(|_| allowed());
        assert!(homes.iter().all(|cores| cores.len() == 1), "{homes:?}");
        let mut distinct = homes.clone();
        distinct.sort();
        distinct.dedup();
        assert_eq!(distinct.len(), homes.len());
    }
}
