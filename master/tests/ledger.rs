//! The ledger: tracing ends early enough for what is left to do, and not much earlier.

use std::time::Duration;

use master::{
    deadline::{FinishWork, Ledger},
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

/// A frame of which the finish phase takes so long on one thread; half of it when `cores` are two.
fn ledger(deadline_s: f64, work: Duration) -> Ledger {
    let deadline = FrameTime::after_start(Duration::from_secs_f64(deadline_s));
    let mut ledger = Ledger::new(deadline, PIXELS, CORES);
    ledger.rehearsed(FinishWork {
        pixels: PIXELS,
        assemble: work,
        assemble_bare: work / 2,
        encode: Duration::ZERO,
    });
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
    let mut ledger = ledger(8.0, ms(160));
    contend(&mut ledger, 1.0);
    // A quarter of the work is serial, so two cores do it in 5/8 of the time.
    assert_eq!(ledger.finish_time(), ms(100));
    let left = time_left(&ledger);
    assert!(left >= ms(105) && left <= ms(130), "{left:?}");
}

#[test]
fn the_margin_of_a_one_second_frame_is_below_five_percent() {
    let mut ledger = ledger(1.0, ms(300));
    contend(&mut ledger, 1.0);
    assert!(ledger.margin() < ms(50), "{:?}", ledger.margin());
}

#[test]
fn half_a_core_doubles_the_finish_phase() {
    let mut ledger = ledger(8.0, ms(160));
    contend(&mut ledger, 0.5);
    let finish = ledger.finish_time();
    assert!(finish > ms(195) && finish < ms(205), "{finish:?}");
}

#[test]
fn more_threads_than_cores_are_no_sign_of_other_programs() {
    let mut ledger = ledger(8.0, ms(160));
    for _ in 0..80 {
        ledger.cpu_time(BEAT, BEAT * 2, BEAT * 3);
    }
    assert_eq!(ledger.finish_time(), ms(100));
}

#[test]
fn a_short_deadline_keeps_some_time_for_tracing_whatever_was_rehearsed() {
    let ledger = ledger(0.1, ms(5_000));
    assert!(ledger.cut_off() >= at(29), "{}", ledger.cut_off());
}

#[test]
fn a_rehearsal_on_a_smaller_picture_is_scaled_to_the_real_one() {
    let mut ledger = ledger(8.0, ms(160));
    ledger.rehearsed(FinishWork {
        pixels: PIXELS / 4,
        assemble: ms(80),
        assemble_bare: ms(80),
        encode: Duration::ZERO,
    });
    assert_eq!(ledger.finish_time(), ms(200));
    ledger.resize(PIXELS / 2, ms(7));
    assert_eq!(ledger.finish_time(), ms(107));
}

#[test]
fn filling_in_is_given_up_when_it_would_end_after_the_deadline() {
    let ledger = ledger(1.0, ms(160));
    assert!(ledger.affords(at(900)));
    assert!(!ledger.affords(at(901)));
}

proptest! {
    #[test]
    fn less_of_the_cores_more_work_or_later_timers_never_move_the_cut_off_later(
        deadline_s in 0.1f64..100.0, work in 1u64..1_000, share in 0.05f64..1.0, late in 0u64..20,
    ) {
        let mut calm = ledger(deadline_s, ms(work));
        contend(&mut calm, 1.0);
        let mut busy = ledger(deadline_s, ms(work));
        contend(&mut busy, share);
        busy.lateness(ms(late));
        let mut larger = ledger(deadline_s, ms(work + 1));
        contend(&mut larger, 1.0);
        prop_assert!(busy.cut_off() <= calm.cut_off());
        prop_assert!(larger.cut_off() <= calm.cut_off());
        prop_assert!(calm.cut_off() < calm.deadline());
    }
}
