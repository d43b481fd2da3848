//! One thread that loads scenes and sets up frames, so that the client's loop never waits for them.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};

use anyhow::{Context as _, anyhow};
use protocol::message::{Frame as FrameMessage, SceneChunk, SceneRef};

use crate::disk_cache::DiskCache;
use crate::done::{Done, DoneSender, panic_text};
use crate::priority::Priority;
use crate::renderer::{Frame, Renderer};
use crate::scene_cache::SceneCache;

/// Gives work to the thread; when it is dropped, the thread ends with the job it is at.
#[derive(Debug)]
pub struct Loader {
    jobs: mpsc::Sender<(Job, DoneSender)>,
    thread: JoinHandle<()>,
}

#[derive(Debug)]
enum Job {
    Find(SceneRef),
    Take(SceneChunk),
    Build,
    Frame(FrameMessage),
}

impl Loader {
    /// Starts the thread, which keeps scenes on the given disk; those that build a BVH for it have its
    /// priority.
    pub fn start(
        renderer: Box<dyn Renderer>,
        disk: Option<DiskCache>,
        priority: Priority,
    ) -> io::Result<Self> {
        let (jobs, to_do) = mpsc::channel::<(Job, DoneSender)>();
        let work = move || {
            priority.take();
            let mut cache = SceneCache::new(disk);
            for (job, done) in to_do {
                // Nobody listens if the connection has ended meanwhile; the scene stays warm.
                let _ = done.send(run(job, &mut cache, &*renderer));
            }
        };
        let thread = thread::Builder::new().name("loader".to_owned()).spawn(work)?;
        Ok(Self { jobs, thread })
    }

    /// Waits for the job that the thread is at, and all that were given before.
    pub fn join(self) {
        drop(self.jobs);
        // It catches what breaks in it.
        let _ = self.thread.join();
    }

    /// Looks what there is of a scene.
    pub fn find(&self, scene: SceneRef, done: DoneSender) {
        self.give(Job::Find(scene), done);
    }

    /// Takes a chunk of the scene that was looked for last.
    pub fn take(&self, chunk: SceneChunk, done: DoneSender) {
        self.give(Job::Take(chunk), done);
    }

    /// Makes the scene that was looked for last, of all its chunks.
    pub fn build(&self, done: DoneSender) {
        self.give(Job::Build, done);
    }

    /// Sets up a frame of the scene in memory.
    pub fn set_up(&self, frame: FrameMessage, done: DoneSender) {
        self.give(Job::Frame(frame), done);
    }

    fn give(&self, job: Job, done: DoneSender) {
        // The thread catches every panic, so it lives as long as this end.
        let _ = self.jobs.send((job, done));
    }
}

fn run(job: Job, cache: &mut SceneCache, renderer: &dyn Renderer) -> Done {
    match job {
        Job::Find(scene) => Done::Found(cache.find(&scene)),
        Job::Take(chunk) => Done::Chunk(chunk.digest, cache.take(&chunk)),
        Job::Build => Done::Scene(unpanicked(|| cache.build(renderer))),
        Job::Frame(frame) => Done::Frame(frame.frame, unpanicked(|| set_up(&frame, cache))),
    }
}

fn set_up(frame: &FrameMessage, cache: &SceneCache) -> anyhow::Result<Arc<dyn Frame>> {
    let scene = cache.scene().context("no scene is in memory")?;
    scene.scene.set_up(frame)
}

/// Makes an error of a panic: a scene that breaks the loader must not end the worker.
fn unpanicked<T>(work: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(anyhow!(panic_text(&*panic))))
}
