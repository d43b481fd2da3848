//! The ledger: how long the finish phase will take, hence when tracing must end.
//!
//! ```text
//! 0 ──── load, workers join ──── tracing ──── C ── reconstruct ── encode, write ── rename, exit ── D
//! ```
//!
//! **Work.** The finish phase is rehearsed now and then with made-up light, on fewer pixels, on the
//! threads that will do it. The median of the last few rehearsals counts.
//!
//! **Share.** While other programs compute, a thread of ours gets only a share of a core. Two things
//! tell which: the operating system's own count of time run and time waited for the threads that trace,
//! all the time; and the same count for a rehearsal, whose threads may have a higher priority but stand
//! in the way of those that trace. Each of the two is what the finish phase gets, or less. The
//! predicted time is divided by the largest of the last few.
//!
//! **Margin.** A part of the prediction; more when cores are contended, since whose turn it is comes by
//! chance; and what timers were seen to oversleep.
//!
//! C = D − work / share − margin, computed anew many times a second.
//!
//! **If it was wrong.** When at C less time is left than the reconstruction takes, a cheaper one is made,
//! and at last missing pixels stay black ([`Ledger::affords`]): a worse picture, never a later one.

use std::{collections::VecDeque, time::Duration};

use crate::{frame_time::FrameTime, link::Recent};

/// The finish phase of a picture, in time on cores that do nothing else.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FinishWork {
    /// Pixels of the picture.
    pub pixels: usize,
    /// Assembling a picture of which half is missing.
    pub assemble: Duration,
    /// Making the files.
    pub encode: Duration,
}

/// What a rehearsal taught.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rehearsed {
    /// How long it would have taken on free cores.
    pub work: FinishWork,
    /// The share of a core that its threads got.
    pub share: f64,
}

impl FinishWork {
    /// On a slow machine, until something is measured.
    pub fn unknown(pixels: usize) -> Self {
        let each = |nanoseconds| Duration::from_nanos(nanoseconds * pixels as u64);
        Self {
            pixels,
            assemble: each(300),
            encode: each(120),
        }
    }

    /// The same for another number of pixels.
    fn scaled_to(self, pixels: usize) -> Self {
        let scale = pixels as f64 / self.pixels.max(1) as f64;
        Self {
            pixels,
            assemble: self.assemble.mul_f64(scale),
            encode: self.encode.mul_f64(scale),
        }
    }
}

/// From the last byte written to the end of the process, until the picture's size is known.
const LEAVE_UNKNOWN: Duration = Duration::from_millis(40);
/// Rehearsals that are remembered.
const REHEARSALS: usize = 5;
/// Of the last so many the best share counts: a rehearsal is short, and may begin when it is not its turn.
const SHARES: usize = 3;
/// What the real thing costs for each pixel, compared with a rehearsal, which stands between tasks and
/// finds the caches full of their things. Measured: 0.6 to 0.8.
const REAL_PER_REHEARSED: f64 = 0.85;
/// Part of the predicted time that is kept as margin.
const MARGIN_SHARE: f64 = 0.1;
/// Margin for what does not depend on the size of the picture.
const MARGIN_MIN: Duration = Duration::from_millis(18);
/// Margin besides for cores of which the tracing gets nothing, and in proportion for others: whose turn
/// it is comes by chance, whatever the priority.
const MARGIN_CONTENDED: Duration = Duration::from_millis(24);
/// Part of the predicted time that is added to the margin for cores that are entirely contended.
const MARGIN_SHARE_CONTENDED: f64 = 0.3;
/// How fast old measurements of the share are forgotten.
const SHARE_MEMORY: Duration = Duration::from_millis(500);
/// Measurement that is assumed at the start: cores to ourselves, for so long.
const SHARE_ASSUMED: Duration = Duration::from_millis(20);
/// A share below this would say that nothing is ever done.
const SHARE_MIN: f64 = 0.05;

/// Plans the end of a frame. Knows no clock; fed with durations.
#[derive(Debug, Clone)]
pub struct Ledger {
    deadline: FrameTime,
    cores: f64,
    pixels: usize,
    leave: Duration,
    rehearsals: VecDeque<Rehearsed>,
    share: Share,
    lateness: Recent,
}

/// Time run of time wanted, both fading.
#[derive(Debug, Clone)]
struct Share {
    ran_s: f64,
    wanted_s: f64,
}

impl Share {
    fn of_tracing(&self) -> f64 {
        (self.ran_s / self.wanted_s).clamp(SHARE_MIN, 1.0)
    }
}

impl Ledger {
    /// A frame of so many pixels on a machine with so many cores, of which nothing else is known.
    pub fn new(deadline: FrameTime, pixels: usize, cores: usize) -> Self {
        let assumed = SHARE_ASSUMED.as_secs_f64();
        Self {
            deadline,
            cores: cores.max(1) as f64,
            pixels,
            leave: LEAVE_UNKNOWN,
            rehearsals: VecDeque::new(),
            share: Share {
                ran_s: assumed,
                wanted_s: assumed,
            },
            lateness: Recent::default(),
        }
    }

    /// The picture has so many pixels, as is now known, and after its files are written it takes so long
    /// to put them in their places and to end the process.
    pub fn resize(&mut self, pixels: usize, leave: Duration) {
        self.pixels = pixels;
        self.leave = leave;
    }

    /// The finish phase was rehearsed, on a picture of any size.
    pub fn rehearsed(&mut self, rehearsed: Rehearsed) {
        if self.rehearsals.len() == REHEARSALS {
            self.rehearsals.pop_front();
        }
        self.rehearsals.push_back(rehearsed);
    }

    /// In an interval of this length threads of ours ran, and wanted to run, for these times in all.
    ///
    /// What they wanted beyond all cores they could not have had on a machine to themselves either.
    pub fn cpu_time(&mut self, interval: Duration, ran: Duration, wanted: Duration) {
        let fade = (-interval.as_secs_f64() / SHARE_MEMORY.as_secs_f64()).exp();
        let possible = interval.mul_f64(self.cores);
        self.share.ran_s = fade * self.share.ran_s + ran.as_secs_f64();
        self.share.wanted_s = fade * self.share.wanted_s + wanted.min(possible).max(ran).as_secs_f64();
    }

    /// A timer fired so much too late.
    pub fn lateness(&mut self, lateness: Duration) {
        self.lateness.push(lateness);
    }

    /// When the picture must be there.
    pub fn deadline(&self) -> FrameTime {
        self.deadline
    }

    /// The moment after which no result counts.
    pub fn cut_off(&self) -> FrameTime {
        self.deadline - (self.finish_time() + self.margin())
    }

    /// Whether there is time for this part of the work that was rehearsed.
    pub fn affords(&self, now: FrameTime, part: f64) -> bool {
        now + self.finish_time().mul_f64(part) <= self.deadline
    }

    /// Predicted time from the cut-off to the end of the process.
    pub fn finish_time(&self) -> Duration {
        (self.work() + self.leave).div_f64(self.share())
    }

    /// Time that is kept besides.
    pub fn margin(&self) -> Duration {
        let contended = 1.0 - self.share();
        let part = MARGIN_SHARE + MARGIN_SHARE_CONTENDED * contended;
        MARGIN_MIN
            + self.finish_time().mul_f64(part)
            + MARGIN_CONTENDED.mul_f64(1.0 - self.share.of_tracing())
            + self.lateness.high().unwrap_or_default()
    }

    /// The share of a core that a thread of the finish phase is expected to get.
    pub fn share(&self) -> f64 {
        let tracing = self.share.of_tracing();
        let recent = self.rehearsals.iter().rev().take(SHARES);
        let rehearsed = recent.map(|rehearsed| rehearsed.share).fold(0.0, f64::max);
        tracing.max(rehearsed).clamp(SHARE_MIN, 1.0)
    }

    /// Assembling and encoding on free cores.
    fn work(&self) -> Duration {
        let scaled = |rehearsed: &Rehearsed| {
            let work = rehearsed.work.scaled_to(self.pixels);
            (work.assemble + work.encode).mul_f64(REAL_PER_REHEARSED)
        };
        let mut durations: Vec<Duration> = self.rehearsals.iter().map(scaled).collect();
        durations.sort_unstable();
        // Of two the smaller: what disturbs a rehearsal makes it longer.
        durations
            .get(durations.len().saturating_sub(1) / 2)
            .copied()
            .unwrap_or_else(|| {
                let unknown = FinishWork::unknown(self.pixels);
                unknown.assemble + unknown.encode
            })
    }
}
