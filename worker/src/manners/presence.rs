//! For how long nobody has touched the machine, from several signs, none of which says what was typed.

use std::time::Duration;

/// Signs of somebody at the machine. What a machine does not tell is `None`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Signs {
    /// What the login manager says: how long all sessions have been idle; zero if one is not.
    pub session: Option<Duration>,
    /// How long ago something was last typed on any terminal, also over the network.
    pub terminal: Option<Duration>,
    /// Interrupts of keyboards, mice and touchpads so far.
    pub interrupts: Option<u64>,
}

/// What the signs say together.
#[derive(Debug, Default)]
pub struct Presence {
    /// When somebody was here last, as far as is known. What was before the first look counts as its
    /// time, if nothing tells better.
    touched_at: Option<Duration>,
    /// Whether something tells at all.
    is_known: bool,
    /// How long nobody had been here before the worker's start.
    untouched_before: Duration,
    interrupts: Option<u64>,
}

impl Presence {
    /// Takes a look at the signs.
    pub fn look(&mut self, now: Duration, signs: &Signs) {
        // Terminals tell that somebody is there, but not that nobody is: a graphical session uses none.
        self.is_known = signs.session.is_some() || signs.interrupts.is_some();
        let agos = [signs.session, signs.terminal, self.interrupted(signs)];
        for ago in agos.into_iter().flatten() {
            self.touched(now, ago);
        }
    }

    /// For how long nobody has touched the machine; `None` if nothing tells.
    pub fn untouched(&self, now: Duration) -> Option<Duration> {
        let since = now.saturating_sub(self.touched_at?);
        self.is_known.then(|| since + self.untouched_before)
    }

    /// Zero when the count has changed. The first count tells nothing of the time before; so that
    /// somebody may have been here just then, unless the login manager knows.
    fn interrupted(&mut self, signs: &Signs) -> Option<Duration> {
        let count = signs.interrupts?;
        let is_touch = match self.interrupts.replace(count) {
            Some(before) => count != before,
            None => signs.session.is_none(),
        };
        is_touch.then_some(Duration::ZERO)
    }

    fn touched(&mut self, now: Duration, ago: Duration) {
        let (at, before) = (now.saturating_sub(ago), ago.saturating_sub(now));
        match self.touched_at {
            Some(known) if known > at => {}
            Some(known) if known == at => self.untouched_before = self.untouched_before.min(before),
            _ => (self.touched_at, self.untouched_before) = (Some(at), before),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    fn session(ago: u64) -> Signs {
        Signs {
            session: Some(s(ago)),
            ..Signs::default()
        }
    }

    fn interrupts(count: u64) -> Signs {
        Signs {
            interrupts: Some(count),
            ..Signs::default()
        }
    }

    #[test]
    fn without_a_sign_nothing_is_known() {
        let mut presence = Presence::default();
        presence.look(s(5), &Signs::default());
        assert_eq!(presence.untouched(s(5)), None);
    }

    #[test]
    fn a_session_that_was_idle_long_before_the_start_is_believed() {
        let mut presence = Presence::default();
        presence.look(s(1), &session(3600));
        assert_eq!(presence.untouched(s(2)), Some(s(3601)));
        presence.look(s(10), &session(0));
        assert_eq!(presence.untouched(s(12)), Some(s(2)));
    }

    #[test]
    fn an_interrupt_is_a_touch_and_so_is_the_unknown_time_before_the_first_look() {
        let mut presence = Presence::default();
        presence.look(s(10), &interrupts(7));
        assert_eq!(presence.untouched(s(10)), Some(s(0)));
        presence.look(s(20), &interrupts(7));
        assert_eq!(presence.untouched(s(20)), Some(s(10)));
        presence.look(s(21), &interrupts(8));
        assert_eq!(presence.untouched(s(21)), Some(s(0)));
    }

    #[test]
    fn the_latest_sign_counts_whatever_the_others_say() {
        let mut presence = Presence::default();
        let signs = Signs {
            session: Some(s(900)),
            terminal: Some(s(4)),
            interrupts: None,
        };
        presence.look(s(100), &signs);
        assert_eq!(presence.untouched(s(100)), Some(s(4)));
        presence.look(
            s(110),
            &Signs {
                terminal: None,
                ..signs
            },
        );
        assert_eq!(presence.untouched(s(110)), Some(s(14)));
    }

    #[test]
    fn terminals_alone_do_not_tell_that_nobody_is_there() {
        let mut presence = Presence::default();
        let signs = Signs {
            terminal: Some(s(9000)),
            ..Signs::default()
        };
        presence.look(s(1), &signs);
        assert_eq!(presence.untouched(s(1)), None);
    }
}
