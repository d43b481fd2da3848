//! The hours of a week.

use std::fmt;
use std::str::FromStr;

const MINUTES_PER_DAY: u32 = 24 * 60;
const MINUTES_PER_WEEK: u32 = 7 * MINUTES_PER_DAY;
const DAYS: [&str; 7] = ["Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun"];

/// A minute of the week in local time, 0 being Monday at midnight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WeekMinute(u32);

impl WeekMinute {
    /// `day` counts from Monday, 0 to 6; `minute` is of the day.
    pub fn new(day: u32, minute: u32) -> Self {
        Self((day * MINUTES_PER_DAY + minute) % MINUTES_PER_WEEK)
    }
}

/// The same hours of some days, such as `Mon-Fri 18:00-08:00` (until the next morning), `Sat-Sun` or
/// `22:00-06:00`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hours {
    /// The first day and how many follow.
    first_day: u32,
    days: u32,
    /// Minute of the day.
    begin: u32,
    minutes: u32,
}

impl Hours {
    /// Whether a minute is among these.
    pub fn contain(self, WeekMinute(minute): WeekMinute) -> bool {
        (0..self.days).any(|day| {
            let begin = (self.first_day + day) * MINUTES_PER_DAY + self.begin;
            (minute + 2 * MINUTES_PER_WEEK - begin) % MINUTES_PER_WEEK < self.minutes
        })
    }
}

/// Why a text names no hours.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("give days, hours or both, as in \"Mon-Fri 18:00-08:00\", \"Sat-Sun\" or \"22:00-06:00\"")]
pub struct NoHours;

impl FromStr for Hours {
    type Err = NoHours;

    fn from_str(text: &str) -> Result<Self, NoHours> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let (days, hours) = match words[..] {
            [word] if word.starts_with(|first: char| first.is_ascii_digit()) => (None, Some(word)),
            [word] => (Some(word), None),
            [days, hours] => (Some(days), Some(hours)),
            _ => return Err(NoHours),
        };
        let (first_day, last_day) = days.map_or(Ok((0, 6)), |days| range_of(days, day))?;
        let (begin, end) = hours.map_or(Ok((0, MINUTES_PER_DAY)), |hours| range_of(hours, minute))?;
        let minutes = match (end + MINUTES_PER_DAY - begin) % MINUTES_PER_DAY {
            0 => MINUTES_PER_DAY,
            minutes => minutes,
        };
        Ok(Self {
            first_day,
            days: (last_day + 7 - first_day) % 7 + 1,
            begin,
            minutes,
        })
    }
}

impl fmt::Display for Hours {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let day = |day: u32| DAYS[day as usize % DAYS.len()];
        let time = |minute: u32| format!("{:02}:{:02}", minute / 60 % 24, minute % 60);
        let (first, last) = (day(self.first_day), day(self.first_day + self.days - 1));
        write!(
            f,
            "{first}-{last} {}-{}",
            time(self.begin),
            time(self.begin + self.minutes)
        )
    }
}

/// Both ends of `a-b`; `a` alone is both.
fn range_of(text: &str, end: fn(&str) -> Option<u32>) -> Result<(u32, u32), NoHours> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    Ok((end(first).ok_or(NoHours)?, end(last).ok_or(NoHours)?))
}

fn day(text: &str) -> Option<u32> {
    let day = DAYS.iter().position(|name| name.eq_ignore_ascii_case(text));
    day.map(|day| day as u32)
}

fn minute(text: &str) -> Option<u32> {
    let (hour, minute) = text.split_once(':')?;
    let is_number = |text: &str| text.len() == 2 && text.bytes().all(|byte| byte.is_ascii_digit());
    if !is_number(hour) || !is_number(minute) {
        return None;
    }
    let (hour, minute): (u32, u32) = (hour.parse().ok()?, minute.parse().ok()?);
    let minutes = hour * 60 + minute;
    (minute < 60 && minutes <= MINUTES_PER_DAY).then_some(minutes)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MONDAY: u32 = 0;
    const FRIDAY: u32 = 4;
    const SATURDAY: u32 = 5;
    const SUNDAY: u32 = 6;

    fn check(text: &str, day: u32, hour: u32, contained: bool) {
        let hours: Hours = text.parse().unwrap();
        let minute = WeekMinute::new(day, hour * 60);
        assert_eq!(hours.contain(minute), contained, "{text}, day {day}, {hour}:00");
        let again: Hours = hours.to_string().parse().unwrap();
        assert_eq!(again, hours, "{text} is shown as {hours}");
    }

    #[test]
    fn hours_that_end_before_they_begin_last_until_the_next_morning() {
        check("Mon-Fri 18:00-08:00", MONDAY, 17, false);
        check("Mon-Fri 18:00-08:00", MONDAY, 18, true);
        check("Mon-Fri 18:00-08:00", FRIDAY, 23, true);
        check("Mon-Fri 18:00-08:00", SATURDAY, 7, true);
        check("Mon-Fri 18:00-08:00", SATURDAY, 8, false);
        check("Mon-Fri 18:00-08:00", MONDAY, 7, false);
        check("Sun 22:00-06:00", MONDAY, 5, true);
    }

    #[test]
    fn days_alone_are_whole_and_hours_alone_are_of_every_day() {
        check("Sat-Sun", FRIDAY, 23, false);
        check("Sat-Sun", SATURDAY, 0, true);
        check("Sat-Sun", SUNDAY, 23, true);
        check("Fri-Mon", SUNDAY, 12, true);
        check("sun", SUNDAY, 12, true);
        check("22:00-06:00", SUNDAY, 23, true);
        check("22:00-06:00", SUNDAY, 12, false);
        check("08:00-24:00", SUNDAY, 23, true);
    }

    #[test]
    fn what_names_no_hours_is_refused() {
        for text in [
            "",
            "never",
            "Mon 25:00-26:00",
            "Mon 8-9",
            "Mon 08:00-09:60",
            "Mon 08:00 09:00",
            "Mon-",
        ] {
            assert_eq!(text.parse::<Hours>(), Err(NoHours), "{text}");
        }
    }
}
