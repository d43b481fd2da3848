//! Threads that the deadline waits for: on a core each, and before others where that is allowed.
//!
//! Threads that wake each other are put on the same core by Linux, unless another one is idle; it takes
//! a tenth of a second until they are spread out again, which is as long as the whole finish phase. So
//! each thread of the finish phase stays on a core of its own. Beside a busy program that halves the
//! finish phase, and a higher priority halves it again.

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use rustix::{
    process::setpriority_process,
    thread::{CpuSet, sched_getaffinity, sched_setaffinity},
};

/// Ahead of programs of ordinary priority, behind what the system itself needs.
const NICE: i32 = -10;

/// Starts the threads of the finish phase; they sleep until they are needed.
pub fn pool() -> Result<ThreadPool, ThreadPoolBuildError> {
    let cores = allowed();
    ThreadPoolBuilder::new()
        // None known: as many as the library thinks right, wherever the system puts them.
        .num_threads(cores.len())
        .thread_name(|index| format!("finish {index}"))
        .start_handler(move |index| {
            if let Some(core) = cores.get(index) {
                stay_on(*core);
            }
            go_first();
        })
        .build()
}

/// Starts threads on all cores, wherever the system puts them.
pub fn unbound(are_urgent: bool) -> Result<ThreadPool, ThreadPoolBuildError> {
    ThreadPoolBuilder::new()
        .num_threads(allowed().len())
        .thread_name(|index| format!("prepare {index}"))
        .start_handler(move |_| {
            if are_urgent {
                go_first();
            }
        })
        .build()
}

/// Puts this thread, and those that it starts, before others. Only the superuser may, or who was given
/// the right (`RLIMIT_NICE`); nobody else can be helped.
pub fn go_first() {
    if let Err(error) = setpriority_process(None, NICE) {
        tracing::trace!(%error, "the priority stays as it is");
    }
}

/// The cores that this process may use.
fn allowed() -> Vec<usize> {
    match sched_getaffinity(None) {
        Ok(set) => (0..CpuSet::MAX_CPU).filter(|&core| set.is_set(core)).collect(),
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
