//! Talks to the service manager that has started this worker, if one has: ready, alive, what it does.

use std::time::Duration;

use sd_notify::NotifyState;
use tokio::sync::watch;
use tokio::time::{MissedTickBehavior, interval};

use crate::manners::Allowance;

/// Says that the worker is ready, then that it is alive and how many slots work, for ever. Runs in the
/// network loop, so that a loop that hangs is noticed.
pub async fn report(mut allowance: watch::Receiver<Allowance>) {
    say(&[NotifyState::Ready]);
    // Twice as often as is asked for, as sd_watchdog_enabled(3) advises.
    let every = sd_notify::watchdog_enabled().map(|limit| limit / 2);
    let mut life_signs = interval(every.unwrap_or(Duration::from_secs(3600)));
    life_signs.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        let text = status(&allowance.borrow_and_update());
        say(&[NotifyState::Status(&text)]);
        tokio::select! {
            _ = life_signs.tick() => say(&[NotifyState::Watchdog]),
            Ok(()) = allowance.changed() => {}
        }
    }
}

fn status(allowance: &Allowance) -> String {
    let slots = allowance.slots;
    match &allowance.hindrance {
        Some(hindrance) => format!("{slots} slots: {hindrance}"),
        None => format!("{slots} slots"),
    }
}

fn say(state: &[NotifyState<'_>]) {
    // Without a service manager this does nothing.
    if let Err(error) = sd_notify::notify(state) {
        tracing::debug!(%error, "the service manager does not listen");
    }
}
