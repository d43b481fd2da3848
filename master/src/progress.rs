//! What people see while a frame is rendered: a bar on a terminal, a line now and then elsewhere.

use std::{
    collections::BTreeMap,
    io::{self, IsTerminal, Write},
    time::Duration,
};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use render::task::Component;

use crate::{frame_time::FrameTime, scheduler::Tally};

/// The bar's unit.
const STEPS: u64 = 1_000;
/// Pauses between lines when there is no terminal, as a share of the deadline.
const LINES_PER_FRAME: u32 = 4;
/// The shortest and longest of these pauses.
const LINE_PAUSE_MIN: Duration = Duration::from_secs(1);
const LINE_PAUSE_MAX: Duration = Duration::from_secs(30);

/// What there is to see.
#[derive(Debug, Clone, Copy)]
pub struct Snapshot<'a> {
    /// The present moment.
    pub now: FrameTime,
    /// When the picture must be there.
    pub deadline: Option<FrameTime>,
    /// How far each component is.
    pub tallies: &'a BTreeMap<Component, Tally>,
    /// Slots that are there.
    pub slots: u32,
    /// Rays traced since the last snapshot, and in which time.
    pub rays: u64,
    /// See `rays`.
    pub since: Duration,
}

/// Shows snapshots.
#[derive(Debug)]
pub struct Progress {
    bar: Option<ProgressBar>,
    lines: bool,
    last_line: FrameTime,
}

impl Progress {
    /// A bar if standard error is a terminal, lines if not, nothing if quiet.
    pub fn start(quiet: bool, bars: &MultiProgress) -> Self {
        let is_terminal = io::stderr().is_terminal();
        let bar = (!quiet && is_terminal).then(|| {
            let style = ProgressStyle::with_template("{bar:30} {msg}");
            let bar = ProgressBar::new(STEPS);
            bars.add(bar)
                .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        Self {
            bar,
            lines: !quiet && !is_terminal,
            last_line: FrameTime::START,
        }
    }

    /// Shows how far the frame is.
    pub fn show(&mut self, snapshot: &Snapshot<'_>) {
        if let Some(bar) = &self.bar {
            bar.set_position((STEPS as f64 * done_share(snapshot)) as u64);
            bar.set_message(text(snapshot));
        } else if self.lines && self.last_line.until(snapshot.now) >= line_pause(snapshot.deadline) {
            self.last_line = snapshot.now;
            say(&text(snapshot));
        }
    }

    /// The reference has no tasks, only a share of its rows.
    pub fn show_share(&mut self, now: FrameTime, share: f32) {
        let text = format!(
            "{:.1} s | {:.0} % of the paths",
            now.elapsed().as_secs_f64(),
            100.0 * share
        );
        if let Some(bar) = &self.bar {
            bar.set_position((STEPS as f32 * share) as u64);
            bar.set_message(text);
        } else if self.lines && self.last_line.until(now) >= line_pause(None) {
            self.last_line = now;
            say(&text);
        }
    }

    /// What people should know before it begins.
    pub fn announce(&mut self, line: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| say(line)),
            None if self.lines => say(line),
            None => {}
        }
    }

    /// Takes the bar away and writes the last line.
    pub fn finish(&mut self, line: &str) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        if self.bar.is_some() || self.lines {
            say(line);
        }
    }
}

fn say(line: &str) {
    // Nobody can be told that nobody can be told.
    let _ = writeln!(io::stderr(), "{line}");
}

fn line_pause(deadline: Option<FrameTime>) -> Duration {
    let pause = deadline.map_or(LINE_PAUSE_MAX, |deadline| deadline.elapsed() / LINES_PER_FRAME);
    pause.clamp(LINE_PAUSE_MIN, LINE_PAUSE_MAX)
}

fn done_share(snapshot: &Snapshot<'_>) -> f64 {
    let (done, total) = snapshot.tallies.values().fold((0, 0), |(done, total), tally| {
        (done + tally.completed + tally.partial, total + tally.total)
    });
    f64::from(done) / f64::from(total.max(1))
}

fn text(snapshot: &Snapshot<'_>) -> String {
    let seconds = snapshot.now.elapsed().as_secs_f64();
    let time = match snapshot.deadline {
        Some(deadline) => format!("{seconds:.1} of {:.1} s", deadline.elapsed().as_secs_f64()),
        None => format!("{seconds:.1} s"),
    };
    let tasks = snapshot.tallies.iter().map(|(&component, tally)| {
        let name = component_name(component);
        format!("{name} {}/{}", tally.completed, tally.total)
    });
    let slots = format!("{} slots", snapshot.slots);
    let rays_per_second = snapshot.rays as f64 / snapshot.since.as_secs_f64().max(1e-3);
    let rays = format!("{:.1} Mrays/s", rays_per_second / 1e6);
    let parts: Vec<String> = [time].into_iter().chain(tasks).chain([slots, rays]).collect();
    parts.join(" | ")
}

/// The name of a component in reports.
pub fn component_name(component: Component) -> &'static str {
    match component {
        Component::Direct => "direct",
        Component::Indirect => "indirect",
        Component::Full => "full",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_says_how_far_each_component_is_and_how_fast() {
        let tally = Tally {
            total: 1024,
            issued: 600,
            completed: 512,
            partial: 0,
        };
        let tallies = [(Component::Direct, tally), (Component::Indirect, tally)].into();
        let snapshot = Snapshot {
            now: FrameTime::after_start(Duration::from_millis(3_240)),
            deadline: Some(FrameTime::after_start(Duration::from_secs(8))),
            tallies: &tallies,
            slots: 2,
            rays: 8_000_000,
            since: Duration::from_millis(100),
        };
        let expected = "3.2 of 8.0 s | direct 512/1024 | indirect 512/1024 | 2 slots | 80.0 Mrays/s";
        assert_eq!(text(&snapshot), expected);
        assert!((done_share(&snapshot) - 0.5).abs() < 1e-9);
    }
}
