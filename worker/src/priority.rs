//! How a thread stands in line for a core.

use clap::ValueEnum;
use rustix::process::setpriority_process;
use thread_priority::ThreadPriority;
use thread_priority::unix::{
    NormalThreadSchedulePolicy, ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
    thread_schedule_policy,
};

/// The lowest of the ordinary priorities.
pub(crate) const NICE: i32 = 19;

/// How threads that make light stand in line for a core.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Priority {
    /// Behind everything else: the scheduling class `SCHED_IDLE`, and nice 19 for systems and tools
    /// that look at that.
    Idle,
    /// Like any program that somebody has started and waits for.
    Ordinary,
}

impl Priority {
    /// Puts this thread into its place, and all threads that it starts from now on. A system that
    /// refuses is told of in the log; the work is done all the same.
    pub fn take(self) {
        if self == Self::Ordinary {
            return;
        }
        if !be_idle() {
            tracing::warn!("the system does not allow SCHED_IDLE; only nice {NICE} keeps renderings back");
        }
        if let Err(error) = setpriority_process(None, NICE) {
            tracing::warn!(%error, "the system does not allow nice {NICE}");
        }
    }
}

/// Whether this thread is of the idle class afterwards.
pub(crate) fn be_idle() -> bool {
    let idle = ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Idle);
    // It sets the nice value too, which an unprivileged thread may not raise again; what counts is
    // the class.
    let _ = set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Min, idle);
    thread_schedule_policy() == Ok(idle)
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    #[test]
    fn an_idle_thread_and_those_it_starts_are_of_the_idle_class_with_nice_19() {
        let idle = ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Idle);
        let look = || {
            let nice = rustix::process::getpriority_process(None).unwrap();
            (thread_schedule_policy().unwrap(), nice)
        };
        let (own, child) = thread::spawn(move || {
            Priority::Idle.take();
            (look(), thread::spawn(look).join().unwrap())
        })
        .join()
        .unwrap();
        assert_eq!((own, child), ((idle, NICE), (idle, NICE)));
        assert_ne!(look().0, idle, "other threads stay as they were");
    }
}
