//! Renders tasks for a master on the cores that are free.
//!
//! [`state`] decides, on one connection, what to do about each message, and [`manners`] how many slots may
//! work; both are pure. Around them is the shell: [`client`] carries bytes, [`loader`] and [`executor`]
//! make light in threads of their own, and [`done`] is the channel between the two. [`overseer`] looks at
//! the [`machine`], [`control`] listens to people and shows them the [`status`], [`service`] talks to systemd.
//! [`priority`] and [`autogroup`] put the worker behind other programs. [`renderer`] says what the worker needs
//! of a renderer, [`traced`] is the real one.

pub mod cli;
pub mod options;
pub mod settings;

pub mod backoff;
pub mod manners;
pub mod state;

pub mod autogroup;
pub mod client;
pub mod clock;
pub mod control;
pub mod disk_cache;
pub mod doctor;
pub mod done;
pub mod executor;
pub mod exit;
pub mod loader;
pub mod machine;
pub mod overseer;
pub mod pace;
pub mod priority;
pub mod renderer;
pub mod scene_cache;
pub mod service;
pub mod signals;
pub mod status;
pub mod traced;

use anyhow::Context as _;

pub use client::Ended;
pub use options::{Lifetime, WorkerOptions};
pub use priority::Priority;
pub use signals::Stop;

use crate::client::Client;
use crate::clock::Clock;
use crate::renderer::Renderer;
use crate::signals::Signals;
use crate::traced::TracingRenderer;

/// Works until told to stop; blocks. Not to be called from within an async runtime.
pub fn run(options: WorkerOptions) -> anyhow::Result<Ended> {
    let clock = Clock::start();
    let renderer = TracingRenderer::new(clock);
    // A worker of one master is in the session of whoever waits for the picture.
    if options.lifetime == Lifetime::Service && options.priority == Priority::Idle {
        autogroup::stand_back().context("cannot start a thread")?;
    }
    run_with(options, clock, Box::new(renderer))
}

/// Works with the given renderer.
pub fn run_with(options: WorkerOptions, clock: Clock, renderer: Box<dyn Renderer>) -> anyhow::Result<Ended> {
    in_network_loop(async {
        let signals = Signals::listen(options.lifetime.clone()).context("cannot listen for signals")?;
        Client::new(options, clock, renderer, signals)?.run().await
    })
}

/// Works as a part of another program until that says so; blocks. Its signals stay its own, and no
/// thread that renders is left behind.
pub fn run_hosted(options: WorkerOptions, stop: Stop) -> anyhow::Result<Ended> {
    let clock = Clock::start();
    let renderer = Box::new(TracingRenderer::new(clock));
    in_network_loop(async {
        let mut client = Client::new(options, clock, renderer, Signals::Host(stop))?;
        let ended = client.run().await;
        client.join();
        ended
    })
}

fn in_network_loop<T>(work: impl Future<Output = anyhow::Result<T>>) -> anyhow::Result<T> {
    let mut runtime = tokio::runtime::Builder::new_current_thread();
    let runtime = runtime
        .enable_all()
        .build()
        .context("cannot start the network loop")?;
    let result = runtime.block_on(work);
    // The look-up of a host's name may hang for long; nobody waits for it any more.
    runtime.shutdown_background();
    result
}
