//! One thread that looks at the machine and says how many slots may work. At ordinary priority, so that
//! it sees an owner who needs all cores.

use std::io;
use std::mem::discriminant;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;

use tokio::sync::{oneshot, watch};

use crate::clock::Clock;
use crate::machine::Machine;
use crate::manners::{Allowance, Event, Hindrance, Manners, Policy};

/// The thread, which ends when this is dropped.
#[derive(Debug)]
pub struct Overseer {
    orders: mpsc::Sender<Order>,
    allowance: watch::Receiver<Allowance>,
}

/// What the owner wants, and whom to tell when it is done.
type Order = (Event, oneshot::Sender<()>);

impl Overseer {
    /// Starts the thread.
    pub fn start(policy: Policy, machine: Machine, clock: Clock) -> io::Result<Self> {
        let (orders, receiver) = mpsc::channel();
        let manners = Manners::new(policy, machine.cores());
        let (sender, allowance) = watch::channel(manners.allowance(clock.now()));
        thread::Builder::new()
            .name("overseer".to_owned())
            .spawn(move || oversee(manners, &machine, clock, &receiver, &sender))?;
        Ok(Self { orders, allowance })
    }

    /// How many slots may work; notifies when their number or what hinders them has changed.
    pub fn allowance(&self) -> watch::Receiver<Allowance> {
        self.allowance.clone()
    }

    /// Passes on what the owner wants; returns when the allowance is what follows from it.
    pub async fn order(&self, order: Event) {
        let (done, is_done) = oneshot::channel();
        // The thread lives as long as this end, and answers at once.
        if self.orders.send((order, done)).is_ok() {
            let _ = is_done.await;
        }
    }
}

fn oversee(
    mut manners: Manners,
    machine: &Machine,
    clock: Clock,
    orders: &mpsc::Receiver<Order>,
    allowance: &watch::Sender<Allowance>,
) {
    loop {
        let now = clock.now();
        let (event, done) = match orders.recv_timeout(manners.poll_timeout(now).saturating_sub(now)) {
            Ok((order, done)) => (order, Some(done)),
            Err(RecvTimeoutError::Timeout) if clock.now() >= manners.look_at() => {
                (Event::Looked(machine.look()), None)
            }
            Err(RecvTimeoutError::Timeout) => (Event::Glanced(machine.signs()), None),
            Err(RecvTimeoutError::Disconnected) => return,
        };
        let now = clock.now();
        manners.handle(now, event);
        publish(allowance, manners.allowance(now));
        if let Some(done) = done {
            // Who gave the order may be gone.
            let _ = done.send(());
        }
    }
}

/// Lets others know what is new, and people if work begins or ends.
fn publish(allowance: &watch::Sender<Allowance>, new: Allowance) {
    allowance.send_if_modified(|old| {
        let kind = |allowance: &Allowance| allowance.hindrance.as_ref().map(discriminant);
        let is_news = old.slots != new.slots || kind(old) != kind(&new);
        if is_news {
            say(old, &new);
        }
        *old = new;
        is_news
    });
}

fn say(old: &Allowance, new: &Allowance) {
    let was_at_work = old.slots > 0 || old.hindrance == Some(Hindrance::Looking);
    match &new.hindrance {
        Some(hindrance) if new.slots == 0 && was_at_work => {
            tracing::info!("no slot works for now: {hindrance}");
        }
        _ if old.slots == 0 && new.slots > 0 => tracing::info!(slots = new.slots, "slots may work"),
        _ => {}
    }
}
