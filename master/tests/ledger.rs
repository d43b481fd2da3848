//! The ledger: tracing ends early enough for what is left to do, and not much earlier.

use std::time::Duration;

use master::{
    deadline::{FinishWork, Ledger, Rehearsed},
    frame_time::FrameTime,
};
use proptest::prelude::*;

const PIXELS: usize = 1024 * 768;
const CORES: usize = 2;
const BEAT: Duration = ms(25);

const fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

fn at(milliseconds: u64) -> FrameTime {
    FrameTime::after_start(ms(milliseconds))
}

/// The finish phase of a whole picture, in time on free cores.
fn work(milliseconds: u64) -> FinishWork {
    FinishWork {
        pixels: PIXELS,
        assemble: ms(milliseconds),
        encode: Duration::ZERO,
    }
}

/// A rehearsal on all pixels. What was rehearsed costs 85 % of that when it is real.
fn rehearsal(milliseconds: u64, share: f64) -> Rehearsed {
    Rehearsed {
        work: work(milliseconds),
        share,
    }
}

/// A frame of which the finish phase was rehearsed once, threads of ordinary priority standing in each
/// other's way.
fn ledger(deadline_s: f64, milliseconds: u64) -> Ledger {
    let deadline = FrameTime::after_start(Duration::from_secs_f64(deadline_s));
    let mut ledger = Ledger::new(deadline, PIXELS, CORES);
    ledger.rehearsed(rehearsal(milliseconds, 0.1));
    ledger.resize(PIXELS, Duration::ZERO);
    ledger
}

/// For two seconds, threads that want both cores get this share of them.
fn contend(ledger: &mut Ledger, share: f64) {
    for _ in 0..80 {
        let wanted = BEAT * CORES as u32;
        ledger.cpu_time(BEAT, wanted.mul_f64(share), wanted);
    }
}

fn time_left(ledger: &Ledger) -> Duration {
    ledger.cut_off().until(ledger.deadline())
}

#[test]
fn the_cut_off_leaves_time_for_the_rehearsed_finish_and_a_small_margin() {
    let mut ledger = ledger(8.0, 100);
    contend(&mut ledger, 1.0);
    assert_eq!(ledger.finish_time(), ms(85));
    let left = time_left(&ledger);
    assert!(left >= ms(105) && left <= ms(120), "{left:?}");
}

#[test]
fn the_margin_of_a_one_second_frame_is_below_five_percent() {
    let mut ledger = ledger(1.0, 200);
    contend(&mut ledger, 1.0);
    assert!(ledger.margin() < ms(50), "{:?}", ledger.margin());
}

#[test]
fn half_a_core_doubles_the_finish_phase() {
    let mut ledger = ledger(8.0, 100);
    contend(&mut ledger, 0.5);
    let finish = ledger.finish_time();
    assert!(finish > ms(165) && finish < ms(175), "{finish:?}");
}

#[test]
fn threads_that_go_first_get_the_share_that_they_got_in_the_rehearsal() {
    let mut ledger = ledger(8.0, 100);
    contend(&mut ledger, 0.5);
    ledger.rehearsed(rehearsal(100, 0.8));
    assert_eq!(ledger.finish_time(), Duration::from_micros(106_250));
}

#[test]
fn beside_other_programs_more_time_is_kept_even_for_threads_that_go_first() {
    let margin = |share| {
        let mut ledger = ledger(8.0, 100);
        contend(&mut ledger, share);
        ledger.rehearsed(rehearsal(100, 1.0));
        ledger.margin()
    };
    assert!(margin(0.5) >= margin(1.0) + ms(11));
}

#[test]
fn more_threads_than_cores_are_no_sign_of_other_programs() {
    let mut ledger = ledger(8.0, 100);
    for _ in 0..80 {
        ledger.cpu_time(BEAT, BEAT * 2, BEAT * 3);
    }
    assert_eq!(ledger.finish_time(), ms(85));
}

#[test]
fn one_rehearsal_that_went_wrong_among_others_does_not_count() {
    let mut ledger = ledger(8.0, 100);
    for milliseconds in [900, 100, 100] {
        ledger.rehearsed(rehearsal(milliseconds, 1.0));
    }
    assert_eq!(ledger.finish_time(), ms(85));
}

#[test]
fn a_rehearsal_on_a_smaller_picture_is_scaled_to_the_real_one() {
    let deadline = FrameTime::after_start(ms(8_000));
    let mut ledger = Ledger::new(deadline, PIXELS, CORES);
    let small = FinishWork {
        pixels: PIXELS / 4,
        ..work(50)
    };
    ledger.rehearsed(Rehearsed {
        work: small,
        share: 1.0,
    });
    ledger.resize(PIXELS, ms(7));
    assert_eq!(ledger.finish_time(), ms(177));
}

#[test]
fn filling_in_is_given_up_when_it_would_end_after_the_deadline() {
    let ledger = ledger(1.0, 100);
    assert!(ledger.affords(at(915), 1.0));
    assert!(!ledger.affords(at(916), 1.0));
    assert!(ledger.affords(at(957), 0.5) && !ledger.affords(at(958), 0.5));
}

proptest! {
    #[test]
    fn less_of_the_cores_more_work_or_later_timers_never_move_the_cut_off_later(
        deadline_s in 0.1f64..100.0, work in 1u64..1_000, share in 0.05f64..1.0, late in 0u64..20,
    ) {
        let mut calm = ledger(deadline_s, work);
        contend(&mut calm, 1.0);
        let mut busy = ledger(deadline_s, work);
        contend(&mut busy, share);
        busy.lateness(ms(late));
        let mut larger = ledger(deadline_s, work + 1);
        contend(&mut larger, 1.0);
        prop_assert!(busy.cut_off() <= calm.cut_off());
        prop_assert!(larger.cut_off() <= calm.cut_off());
        prop_assert!(calm.cut_off() < calm.deadline());
    }
}
