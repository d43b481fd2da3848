//! The owner comes first: decisions from what was seen, without a machine.

use super::*;

const MINUTE: Duration = Duration::from_secs(60);
const CORES: Cores = Cores {
    count: 4,
    threads_per_core: 1,
};

fn policy(when: When) -> Policy {
    Policy {
        when,
        slots_max: 4,
        follow_load: true,
        idle_after: 10 * MINUTE,
        idle_load: 1.0,
        hours: Vec::new(),
        on_battery: false,
    }
}

/// A machine at which nobody has been for an hour.
fn deserted() -> Look {
    Look {
        cpu: Some(CpuTimes {
            all: Duration::ZERO,
            own: Duration::ZERO,
        }),
        signs: touched(60 * MINUTE),
        on_mains: Some(true),
        week_minute: Some(WeekMinute::new(0, 12 * 60)),
    }
}

fn touched(ago: Duration) -> Signs {
    Signs {
        session: Some(ago),
        ..Signs::default()
    }
}

/// A worker's manners and the machine that they look at, second by second.
struct Owned {
    manners: Manners,
    now: Duration,
    look: Look,
}

impl Owned {
    fn new(policy: Policy) -> Self {
        let mut owned = Self {
            manners: Manners::new(policy, CORES),
            now: Duration::ZERO,
            look: deserted(),
        };
        owned.look_for(2, 0.0);
        owned
    }

    /// Looks so often while others use so many cores.
    fn look_for(&mut self, looks: u32, others: f64) -> Allowance {
        for _ in 0..looks {
            self.now += LOOK_EVERY;
            if let Some(cpu) = &mut self.look.cpu {
                cpu.all += LOOK_EVERY.mul_f64(others);
            }
            self.manners.handle(self.now, Event::Looked(self.look.clone()));
        }
        self.allowance()
    }

    fn allowance(&self) -> Allowance {
        self.manners.allowance(self.now)
    }

    #[track_caller]
    fn assert_rests(&self, because: &Hindrance) {
        let Allowance { slots, hindrance } = self.allowance();
        // As people read it: a load is a quotient of times.
        let said = hindrance.as_ref().map(ToString::to_string);
        assert_eq!((slots, said), (0, Some(because.to_string())));
    }
}

#[test]
fn nothing_works_before_the_first_looks() {
    let mut manners = Manners::new(policy(When::Always), CORES);
    assert_eq!(manners.allowance(Duration::ZERO).slots, 0);
    assert_eq!(
        manners.poll_timeout(Duration::ZERO),
        Duration::ZERO,
        "look at once"
    );
    manners.handle(Duration::ZERO, Event::Looked(deserted()));
    assert_eq!(
        manners.allowance(Duration::ZERO).hindrance,
        Some(Hindrance::Looking)
    );
}

#[test]
fn slots_follow_the_cores_that_others_leave_free() {
    let mut owned = Owned::new(policy(When::Always));
    assert_eq!(owned.allowance(), Allowance::all(4));
    let crowded = owned.look_for(1, 3.0);
    assert_eq!(crowded.slots, 1);
    let because = crowded.hindrance.unwrap().to_string();
    assert_eq!(because, Hindrance::Load(3.0).to_string());
    assert_eq!(owned.look_for(3, 0.0), Allowance::all(4));
}

#[test]
fn a_fixed_number_of_slots_does_not_follow_the_load() {
    let fixed = Policy {
        follow_load: false,
        slots_max: 2,
        ..policy(When::Always)
    };
    assert_eq!(Owned::new(fixed).look_for(5, 4.0), Allowance::all(2));
}

#[test]
fn a_system_that_does_not_tell_its_load_gets_all_slots() {
    let mut owned = Owned::new(policy(When::Always));
    owned.manners = Manners::new(policy(When::Always), CORES);
    owned.look.cpu = None;
    assert_eq!(owned.look_for(1, 0.0), Allowance::all(4));
}

#[test]
fn never_is_never() {
    Owned::new(policy(When::Never)).assert_rests(&Hindrance::Never);
}

#[test]
fn an_idle_machine_works_until_somebody_touches_it_and_again_ten_minutes_later() {
    let mut owned = Owned::new(policy(When::Idle));
    assert_eq!(owned.allowance(), Allowance::all(4));
    owned
        .manners
        .handle(owned.now, Event::Glanced(touched(Duration::ZERO)));
    owned.assert_rests(&Hindrance::OwnerHere(Duration::ZERO));
    owned.now += (10 * MINUTE).saturating_sub(2 * LOOK_EVERY);
    assert_eq!(owned.look_for(1, 0.0).slots, 0);
    assert_eq!(owned.look_for(1, 0.0).slots, 4);
}

#[test]
fn a_machine_with_much_load_is_not_idle() {
    let mut owned = Owned::new(policy(When::Idle));
    owned.look_for(1, 1.5);
    owned.assert_rests(&Hindrance::Load(1.5));
}

#[test]
fn where_nothing_tells_idle_means_busy() {
    let mut owned = Owned::new(policy(When::Idle));
    owned.look.signs = Signs::default();
    owned.look_for(1, 0.0);
    owned.assert_rests(&Hindrance::OwnerUnknown);
}

#[test]
fn the_owner_is_looked_for_often_only_while_he_could_be_disturbed() {
    let owned = Owned::new(policy(When::Idle));
    assert_eq!(owned.manners.poll_timeout(owned.now), owned.now + GLANCE_EVERY);
    let owned = Owned::new(policy(When::Always));
    assert_eq!(owned.manners.poll_timeout(owned.now), owned.now + LOOK_EVERY);
    let mut owned = Owned::new(policy(When::Idle));
    owned.manners.handle(owned.now, Event::Pause(MINUTE));
    assert_eq!(owned.manners.poll_timeout(owned.now), owned.now + LOOK_EVERY);
}

#[test]
fn a_pause_ends_by_itself_or_when_the_owner_says_so() {
    let mut owned = Owned::new(policy(When::Always));
    owned.manners.handle(owned.now, Event::Pause(MINUTE));
    owned.assert_rests(&Hindrance::Paused(MINUTE));
    owned.now += MINUTE;
    assert_eq!(owned.allowance().slots, 4);
    owned.manners.handle(owned.now, Event::Pause(Duration::MAX));
    assert_eq!(owned.allowance().slots, 0);
    owned.manners.handle(owned.now, Event::Resume);
    assert_eq!(owned.allowance().slots, 4);
}

#[test]
fn outside_its_hours_or_without_a_clock_a_worker_rests() {
    let hours = vec!["Mon-Fri 18:00-08:00".parse().unwrap(), "Sat-Sun".parse().unwrap()];
    let mut owned = Owned::new(Policy {
        hours,
        ..policy(When::Always)
    });
    owned.assert_rests(&Hindrance::OutsideHours);
    owned.look.week_minute = Some(WeekMinute::new(5, 12 * 60));
    assert_eq!(owned.look_for(1, 0.0).slots, 4);
    owned.look.week_minute = None;
    assert_eq!(owned.look_for(1, 0.0).slots, 0);
}

#[test]
fn on_battery_a_worker_rests_unless_it_may_not_care() {
    let mut owned = Owned::new(policy(When::Always));
    owned.look.on_mains = Some(false);
    owned.look_for(1, 0.0);
    owned.assert_rests(&Hindrance::OnBattery);
    owned.manners.policy.on_battery = true;
    assert_eq!(owned.allowance().slots, 4);
    owned.manners.policy.on_battery = false;
    owned.look.on_mains = None;
    assert_eq!(
        owned.look_for(1, 0.0).slots,
        4,
        "a machine that tells nothing has no battery"
    );
}
