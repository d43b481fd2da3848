//! One thread that loads scenes and sets up frames, so that the client's loop never waits for them.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};

use anyhow::{Context as _, anyhow};
use protocol::message::{Frame as FrameMessage, SceneRef};

use crate::done::{Done, DoneSender, panic_text};
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
    Build(SceneRef, Vec<u8>),
    Frame(FrameMessage),
}

impl Loader {
    /// Starts the thread.
    pub fn start(renderer: Box<dyn Renderer>) -> io::Result<Self> {
        let (jobs, to_do) = mpsc::channel::<(Job, DoneSender)>();
        let work = move || {
            let mut cache = SceneCache::default();
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

    /// Looks whether a scene is the one in memory.
    pub fn find(&self, scene: SceneRef, done: DoneSender) {
        self.give(Job::Find(scene), done);
    }

    /// Makes a scene of its bytes.
    pub fn build(&self, scene: SceneRef, bytes: Vec<u8>, done: DoneSender) {
        self.give(Job::Build(scene, bytes), done);
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
        Job::Build(scene, bytes) => Done::Scene(unpanicked(|| cache.build(&scene, &bytes, renderer))),
        Job::Frame(frame) => Done::Frame(frame.frame, unpanicked(|| set_up(&frame, cache))),
    }
}

fn set_up(frame: &FrameMessage, cache: &SceneCache) -> anyhow::Result<Arc<dyn Frame>> {
    let scene = cache.scene().context("no scene is in memory")?;
    scene.scene.set_up(&frame.settings, &frame.vpl_sets)
}

/// Makes an error of a panic: a scene that breaks the loader must not end the worker.
fn unpanicked<T>(work: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(anyhow!(panic_text(&*panic))))
}
