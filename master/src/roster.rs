//! Everyone who is connected, and what is known of each.

use std::{
    collections::{BTreeMap, VecDeque},
    net::IpAddr,
    time::Duration,
};

use protocol::{
    ToWorker, WorkerId,
    envelope::{EncodeError, Sealed},
    message::Ping,
};
use tokio::sync::mpsc;

use crate::{
    connection::Joined,
    flush::{Flush, lead_times, times_on_the_wire},
    frame_time::FrameTime,
    link::Link,
    report::WorkerReport,
};

/// Pings of which the answers are still waited for.
const PINGS_REMEMBERED: usize = 16;

/// Everyone who is connected.
#[derive(Debug, Default)]
pub struct Roster {
    members: BTreeMap<WorkerId, Member>,
    /// Of all who ever joined, in order.
    reports: Vec<WorkerReport>,
    slots_most: u32,
    ping_next: u64,
}

/// One worker.
#[derive(Debug)]
pub struct Member {
    /// What it calls itself.
    pub name: String,
    host: IpAddr,
    /// Tasks that it renders at a time.
    pub slots: u32,
    /// Whether this process started it.
    pub is_local: bool,
    /// The way to it.
    pub link: Link,
    /// Digest of its scene, once it has one.
    pub prepared: bool,
    /// Whether it may ask for tasks.
    pub ready: bool,
    outbox: mpsc::Sender<Sealed>,
    /// Pings that are not answered, oldest first.
    pings: VecDeque<(u64, FrameTime)>,
    report: usize,
}

impl Roster {
    /// A worker has joined.
    pub fn join(&mut self, joined: Joined, now: FrameTime) -> WorkerId {
        let report = self.reports.len();
        self.reports.push(WorkerReport {
            name: joined.hello.name.clone(),
            address: joined.address.to_string(),
            local: joined.is_local,
            slots: joined.hello.slots,
            joined_s: now.elapsed().as_secs_f64(),
            ..WorkerReport::default()
        });
        let member = Member {
            name: joined.hello.name,
            host: joined.address.ip(),
            slots: joined.hello.slots,
            is_local: joined.is_local,
            link: Link::new(joined.throughput),
            prepared: false,
            ready: false,
            outbox: joined.outbox,
            pings: VecDeque::new(),
            report,
        };
        self.members.insert(joined.worker, member);
        let slots = self.members.values().map(|member| member.slots).sum();
        self.slots_most = self.slots_most.max(slots);
        joined.worker
    }

    /// A worker is gone, or is sent away: its connection closes when what was sent is written.
    pub fn leave(&mut self, worker: WorkerId, why: &str) -> Option<Member> {
        let member = self.members.remove(&worker)?;
        self.reports[member.report].left = Some(why.to_owned());
        Some(member)
    }

    /// A worker that is here.
    pub fn get(&mut self, worker: WorkerId) -> Option<&mut Member> {
        self.members.get_mut(&worker)
    }

    /// All that are here.
    pub fn ids(&self) -> Vec<WorkerId> {
        self.members.keys().copied().collect()
    }

    /// Puts a message into a worker's outbox. False if it has not read for so long that the box is full.
    #[must_use]
    pub fn send(&self, worker: WorkerId, message: Sealed) -> bool {
        let member = self.members.get(&worker);
        // A worker that is gone needs no message and is no news.
        member.is_none_or(|member| member.send(message))
    }

    /// To all; those whose box is full find out by their silence.
    pub fn send_all(&self, message: &ToWorker) -> Result<(), EncodeError> {
        let message = Sealed::new(message)?;
        for member in self.members.values() {
            let _ = member.send(message.clone());
        }
        Ok(())
    }

    /// Pings everyone: a sign of life, and a measurement.
    pub fn ping_all(&mut self, now: FrameTime) -> Result<(), EncodeError> {
        let (nonce, ping) = self.next_ping()?;
        for member in self.members.values_mut() {
            member.send_ping(ping.clone(), nonce, now);
        }
        Ok(())
    }

    /// Pings one worker, of whose way nothing is known.
    pub fn ping(&mut self, worker: WorkerId, now: FrameTime) -> Result<(), EncodeError> {
        let (nonce, ping) = self.next_ping()?;
        if let Some(member) = self.members.get_mut(&worker) {
            member.send_ping(ping, nonce, now);
        }
        Ok(())
    }

    fn next_ping(&mut self) -> Result<(u64, Sealed), EncodeError> {
        let nonce = self.ping_next;
        self.ping_next += 1;
        Ok((nonce, Sealed::new(&ToWorker::Ping(Ping { nonce }))?))
    }

    /// Takes the answer to a ping.
    pub fn pong(&mut self, worker: WorkerId, nonce: u64, now: FrameTime) {
        let Some(member) = self.members.get_mut(&worker) else {
            return;
        };
        let place = member.pings.iter().position(|&(sent, _)| sent == nonce);
        let answered = place.and_then(|place| member.pings.drain(..=place).next_back());
        if let Some((_, sent)) = answered {
            member.link.round_trip(sent.until(now));
        }
    }

    /// How long results of all slots of everyone who is here are on the wires that they share.
    pub fn times_on_the_wire(&self) -> Vec<(WorkerId, Duration)> {
        let times = times_on_the_wire(&self.flushes());
        self.members.keys().copied().zip(times).collect()
    }

    fn flushes(&self) -> Vec<Flush> {
        let members = self.members.values();
        members
            .map(|member| member.link.flush(member.host, member.slots))
            .collect()
    }

    /// The Δt of everyone who is here: they take turns to send their last results.
    pub fn delta_ts(&self) -> Vec<(WorkerId, Duration)> {
        let members = self.members.iter().zip(lead_times(&self.flushes()));
        members
            .map(|((&worker, member), flush)| (worker, member.link.delta_t(flush)))
            .collect()
    }

    /// The longest Δt of all that are here.
    pub fn delta_t_longest(&self) -> Duration {
        let delta_ts = self.delta_ts().into_iter();
        delta_ts.map(|(_, delta_t)| delta_t).max().unwrap_or_default()
    }

    /// What a worker has contributed so far.
    pub fn report(&mut self, worker: WorkerId) -> Option<&mut WorkerReport> {
        let member = self.members.get(&worker)?;
        self.reports.get_mut(member.report)
    }

    /// What everyone has contributed, those who left included.
    pub fn reports(&self) -> &[WorkerReport] {
        &self.reports
    }

    /// Most slots that were there at a time.
    pub fn slots_most(&self) -> u32 {
        self.slots_most
    }

    /// Slots that are there now.
    pub fn slots(&self) -> u32 {
        self.members.values().map(|member| member.slots).sum()
    }
}

impl Member {
    fn send(&self, message: Sealed) -> bool {
        !matches!(
            self.outbox.try_send(message),
            Err(mpsc::error::TrySendError::Full(_))
        )
    }

    fn send_ping(&mut self, ping: Sealed, nonce: u64, now: FrameTime) {
        if self.send(ping) {
            if self.pings.len() == PINGS_REMEMBERED {
                self.pings.pop_front();
            }
            self.pings.push_back((nonce, now));
        }
    }
}
