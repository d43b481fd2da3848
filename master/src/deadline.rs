//! The ledger: how long the finish phase will take, hence when tracing must end.
//!
//! ```text
//! 0 ──── load, workers join ──── tracing ──── C ── reconstruct ── encode, write ── rename, exit ── D
//! ```
//!
//! **Work.** The finish phase is rehearsed at the start with made-up light: on fewer pixels, on one
//! thread, counted in processor time, so that neither a small budget nor busy cores spoil the
//! measurement. Cores divide its parallel part.
//!
//! **Share.** While other programs compute, a thread of ours gets only a share of a core. All through
//! the tracing, when our tasks keep every core busy, the operating system's own count of time run and
//! time waited tells that share; the predicted time is divided by it.
//!
//! **Margin.** A part of the prediction; more when cores are contended, since whose turn it is comes by
//! chance; and what timers were seen to oversleep.
//!
//! C = D − work / share − margin, computed anew many times a second.
//!
//! **If it was wrong.** When at C less time is left than a reconstruction takes, missing pixels stay
//! black ([`Ledger::affords`]): a worse picture, never a later one.

use std::time::Duration;

use crate::{frame_time::FrameTime, link::Recent};

/// The finish phase of a picture, in processor time on one thread.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FinishWork {
    /// Pixels of the picture.
    pub pixels: usize,
    /// Assembling a picture of which half is missing.
    pub assemble: Duration,
    /// Assembling it without filling in what is missing.
    pub assemble_bare: Duration,
    /// Making the larger of the two files.
    pub encode: Duration,
}

impl FinishWork {
    /// On a slow machine, until something is measured.
    pub fn unknown(pixels: usize) -> Self {
        let each = |nanoseconds| Duration::from_nanos(nanoseconds * pixels as u64);
        Self {
            pixels,
            assemble: each(500),
            assemble_bare: each(150),
            encode: each(150),
        }
    }

    /// The same for another number of pixels.
    #[must_use]
    pub fn scaled_to(self, pixels: usize) -> Self {
        let scale = pixels as f64 / self.pixels.max(1) as f64;
        Self {
            pixels,
            assemble: self.assemble.mul_f64(scale),
            assemble_bare: self.assemble_bare.mul_f64(scale),
            encode: self.encode.mul_f64(scale),
        }
    }
}

/// From the last byte written to the end of the process, until the picture's size is known.
const LEAVE_UNKNOWN: Duration = Duration::from_millis(40);
/// Part of the assembly that only one core can do.
const ASSEMBLE_SERIAL: f64 = 0.25;
/// Part of the encoding that only one core can do.
const ENCODE_SERIAL: f64 = 0.8;
/// Part of the predicted time that is kept as margin.
const MARGIN_SHARE: f64 = 0.1;
/// Margin for what does not depend on the size of the picture.
const MARGIN_MIN: Duration = Duration::from_millis(35);
/// Part of the predicted time that is added to the margin for cores that are entirely contended.
const MARGIN_SHARE_CONTENDED: f64 = 0.3;
/// Frames shorter than a few finish phases still trace for this part of their time.
const TRACING_SHARE_MIN: f64 = 0.3;
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
    work: FinishWork,
    leave: Duration,
    share: Share,
    lateness: Recent,
}

/// Time run of time wanted, both fading.
#[derive(Debug, Clone)]
struct Share {
    ran_s: f64,
    wanted_s: f64,
}

impl Ledger {
    /// A frame of so many pixels on a machine with so many cores, of which nothing else is known.
    pub fn new(deadline: FrameTime, pixels: usize, cores: usize) -> Self {
        let assumed = SHARE_ASSUMED.as_secs_f64();
        Self {
            deadline,
            cores: cores.max(1) as f64,
            work: FinishWork::unknown(pixels),
            leave: LEAVE_UNKNOWN,
            share: Share {
                ran_s: assumed,
                wanted_s: assumed,
            },
            lateness: Recent::default(),
        }
    }

    /// The finish phase was rehearsed, on a picture of any size.
    pub fn rehearsed(&mut self, work: FinishWork) {
        self.work = work.scaled_to(self.work.pixels);
    }

    /// The picture has so many pixels, as is now known, and after its files are written it takes so long
    /// to put them in their places and to end the process.
    pub fn resize(&mut self, pixels: usize, leave: Duration) {
        self.work = self.work.scaled_to(pixels);
        self.leave = leave;
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
        let most = self.deadline.elapsed().mul_f64(1.0 - TRACING_SHARE_MIN);
        self.deadline - (self.finish(self.work.assemble) + self.margin()).min(most)
    }

    /// Whether there is time to fill in missing pixels.
    pub fn affords(&self, now: FrameTime) -> bool {
        now + self.finish(self.work.assemble) <= self.deadline
    }

    /// Predicted time from the cut-off to the end of the process.
    pub fn finish_time(&self) -> Duration {
        self.finish(self.work.assemble)
    }

    /// The share of a core that a thread of ours gets.
    pub fn share(&self) -> f64 {
        (self.share.ran_s / self.share.wanted_s).clamp(SHARE_MIN, 1.0)
    }

    fn finish(&self, assemble: Duration) -> Duration {
        let on_cores = |work: Duration, serial: f64| work.mul_f64(serial + (1.0 - serial) / self.cores);
        let alone =
            on_cores(assemble, ASSEMBLE_SERIAL) + on_cores(self.work.encode, ENCODE_SERIAL) + self.leave;
        alone.div_f64(self.share())
    }

    /// Time that is kept besides.
    pub fn margin(&self) -> Duration {
        let contended = 1.0 - self.share();
        let part = MARGIN_SHARE + MARGIN_SHARE_CONTENDED * contended;
        MARGIN_MIN + self.finish_time().mul_f64(part) + self.lateness.high().unwrap_or_default()
    }
}
