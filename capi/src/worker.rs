//! `gridlight_worker`: a worker inside the caller's process.

use std::{
    ffi::c_char,
    sync::{Mutex, PoisonError},
    thread::{self, JoinHandle},
};

use ::worker::settings::{Settings, Slots};
use ::worker::{Ended, Lifetime, Priority, Stop, WorkerOptions, cli};
use protocol::key_file;

use crate::{
    boundary::{Output, free, guard, object, object_mut, text},
    outcome::{Failure, Outcome},
};

/// A worker: renders for a master in threads of this process, until it is stopped.
#[derive(Debug)]
pub struct Worker {
    options: WorkerOptions,
    stop: Stop,
    work: Mutex<Work>,
}

#[derive(Debug)]
enum Work {
    NotStarted,
    Running(JoinHandle<anyhow::Result<Ended>>),
    Over,
}

/// Makes a worker that will use all cores and have the host's name. It does nothing until it is started.
///
/// @param master Where the master listens, as `HOST:PORT`.
/// @param worker_out Receives the worker; free it by gridlight_worker_free.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_worker_new(
    master: *const c_char,
    worker_out: *mut *mut Worker,
) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a string.
        let master = unsafe { text(master, "master") }?;
        // SAFETY: the caller passes the place of a pointer.
        let output = unsafe { Output::at(worker_out, "worker_out") }?;
        let connect = cli::address(master)
            .map_err(|reason| Failure::invalid(format!("`{master}` is no address of a master: {reason}")))?;
        output.give(Worker::new(connect));
        Ok(())
    })
}

/// Stops a worker if it runs, and frees it.
///
/// @param worker May be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_worker_free(worker: *mut Worker) {
    // SAFETY: the caller gives the worker back.
    unsafe { free(worker) };
}

/// Sets how many threads render, from the next start on.
///
/// @param worker The worker, which is not started yet.
/// @param slots Number of threads, up to 1024; 0 for one on each core.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_worker_set_slots(worker: *mut Worker, slots: u32) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live worker.
        let worker = unsafe { object_mut(worker, "worker") }?;
        worker.options.slots = slots_of(slots)?;
        Ok(())
    })
}

/// Sets the name by which people know the worker.
///
/// @param worker The worker, which is not started yet.
/// @param name The name, up to 64 bytes without control characters.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_worker_set_name(worker: *mut Worker, name: *const c_char) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live worker.
        let worker = unsafe { object_mut(worker, "worker") }?;
        // SAFETY: the caller passes a string.
        let name = unsafe { text(name, "name") }?;
        worker.options.name =
            cli::name(name).map_err(|reason| Failure::invalid(format!("`{name}` is no name: {reason}")))?;
        Ok(())
    })
}

/// Reads the key of the grid, the same as the master's: only a master that has it is believed. Without
/// one, only a master that has none lets the worker join.
///
/// @param worker The worker, which is not started yet.
/// @param path The key file; nobody but the user who runs this program may be able to read it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_worker_set_key_file(worker: *mut Worker, path: *const c_char) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live worker.
        let worker = unsafe { object_mut(worker, "worker") }?;
        // SAFETY: the caller passes a string.
        let path = unsafe { text(path, "path") }?;
        let keys = key_file::read(path.as_ref()).map_err(|error| Failure::invalid(error.to_string()))?;
        worker.options.keys = Some(keys);
        Ok(())
    })
}

/// Starts a worker and returns at once. It keeps trying until a master is there, works for it, and looks
/// for the next when that is gone. Signals are left alone, and nothing is printed.
///
/// @param worker The worker.
/// @return GRIDLIGHT_RESULT_WORKER_STARTED if it was started or stopped before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_worker_start(worker: *const Worker) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live worker.
        let worker = unsafe { object(worker, "worker") }?;
        worker.start()
    })
}

/// Stops a worker, from any thread: its tasks end within a few milliseconds, what they have is sent, and
/// when this returns, all of its threads are gone. A BVH that it is building is finished first.
///
/// @param worker The worker. If it does not run, nothing happens, but it cannot be started any more.
/// @return GRIDLIGHT_RESULT_WORKER if it could not work: it lacked memory for its threads, say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn gridlight_worker_stop(worker: *const Worker) -> Outcome {
    guard(|| {
        // SAFETY: the caller passes a live worker.
        let worker = unsafe { object(worker, "worker") }?;
        worker.stop()
    })
}

fn slots_of(slots: u32) -> Result<u32, Failure> {
    let slots = if slots == 0 {
        "auto".to_owned()
    } else {
        slots.to_string()
    };
    let slots: Slots = slots
        .parse()
        .map_err(|reason| Failure::invalid(format!("`slots` is {slots}: {reason}")))?;
    let settings = Settings {
        slots: Some(slots),
        ..Settings::default()
    };
    Ok(settings.slots_max())
}

impl Worker {
    fn new(connect: String) -> Self {
        Self {
            options: WorkerOptions {
                connect,
                keys: None,
                slots: Settings::default().slots_max(),
                name: cli::host_name(),
                // When to render, and how politely, is for the program around it to say.
                policy: None,
                priority: Priority::Ordinary,
                memory_max: Settings::default().memory_max(),
                lifetime: Lifetime::Service,
                // The host has not said that files may be written.
                cache: None,
                version: cli::VERSION.to_owned(),
            },
            stop: Stop::default(),
            work: Mutex::new(Work::NotStarted),
        }
    }

    fn start(&self) -> Result<(), Failure> {
        let mut work = self.work.lock().unwrap_or_else(PoisonError::into_inner);
        if !matches!(*work, Work::NotStarted) {
            let text = "a worker can be started once; make another one";
            return Err(Failure::new(Outcome::WorkerStarted, text));
        }
        let (options, stop) = (self.options.clone(), self.stop.clone());
        let thread = thread::Builder::new()
            .name("gridlight worker".to_owned())
            .spawn(move || ::worker::run_hosted(options, stop))
            .map_err(|error| Failure::new(Outcome::Worker, format!("cannot start a thread: {error}")))?;
        *work = Work::Running(thread);
        Ok(())
    }

    fn stop(&self) -> Result<(), Failure> {
        let mut work = self.work.lock().unwrap_or_else(PoisonError::into_inner);
        let Work::Running(thread) = std::mem::replace(&mut *work, Work::Over) else {
            return Ok(());
        };
        self.stop.stop();
        match thread.join() {
            Ok(Ok(_)) => Ok(()),
            Ok(Err(error)) => Err(Failure::new(Outcome::Worker, format!("{error:#}"))),
            Err(panic) => Err(Failure::of_panic(&*panic)),
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // Whoever wants to know how it went asks before.
        let _ = self.stop();
    }
}
