//! Line plots as SVG, plain enough for any browser and for paper.

use std::fmt::Write;

const WIDTH: f64 = 360.0;
const HEIGHT: f64 = 250.0;
const LEFT: f64 = 46.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = 66.0;
/// Told apart on screen, in grey, and by most colour-blind people.
const COLORS: [&str; 4] = ["#0b6e99", "#c8501e", "#5b8c2a", "#666666"];
const DASHES: [&str; 4] = ["", "7 3", "2 3", "1 0"];

/// A plot.
#[derive(Debug, Clone)]
pub struct Plot {
    /// Above it.
    pub title: String,
    /// Below the horizontal axis.
    pub x_label: &'static str,
    /// What is drawn.
    pub series: Vec<Series>,
}

/// One line, or one kind of points.
#[derive(Debug, Clone)]
pub struct Series {
    /// In the legend.
    pub name: String,
    /// Colour and dashes; equal for what belongs together.
    pub style: usize,
    /// Whether points are marked and not joined.
    pub points_only: bool,
    /// `(x, y)`, by ascending `x`, none negative.
    pub points: Vec<(f64, f64)>,
}

impl Plot {
    /// The plot as an SVG document.
    pub fn to_svg(&self) -> String {
        let scale = Scale::of(self);
        let title = escape(&self.title);
        let series: String = self.series.iter().map(|series| series.to_svg(&scale)).collect();
        format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="11" role="img"><title>{title}</title><rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/><text x="{LEFT}" y="18" font-size="13" font-weight="bold">{title}</text>{}{series}{}</svg>"##,
            self.axes(&scale),
            self.legend()
        )
    }

    fn axes(&self, scale: &Scale) -> String {
        let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
        let mut svg = String::new();
        for tick in ticks(scale.y_max, scale.y_step) {
            let y = scale.y(tick);
            let _ = write!(
                svg,
                r##"<path d="M{LEFT} {y:.1}H{right}" stroke="#ddd"/><text x="{:.1}" y="{:.1}" text-anchor="end">{}</text>"##,
                LEFT - 5.0,
                y + 4.0,
                number(tick, scale.y_step)
            );
        }
        for tick in ticks(scale.x_max, scale.x_step) {
            let _ = write!(
                svg,
                r#"<text x="{:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
                scale.x(tick),
                bottom + 14.0,
                number(tick, scale.x_step)
            );
        }
        let _ = write!(
            svg,
            r##"<path d="M{LEFT} {TOP}V{bottom}H{right}" fill="none" stroke="#333"/><text x="{:.1}" y="{:.1}" text-anchor="middle">{}</text>"##,
            f64::midpoint(LEFT, right),
            bottom + 28.0,
            escape(self.x_label)
        );
        svg
    }

    /// Two columns under the plot.
    fn legend(&self) -> String {
        let mut svg = String::new();
        for (place, series) in self.series.iter().enumerate() {
            let x = 12.0 + (WIDTH - 16.0) / 2.0 * (place % 2) as f64;
            let y = HEIGHT - 26.0 + 16.0 * (place / 2) as f64;
            let color = COLORS[series.style % COLORS.len()];
            let line = if series.points_only {
                mark(x + 10.0, y, color)
            } else {
                let dash = DASHES[series.style % DASHES.len()];
                format!(
                    r#"<path d="M{x} {y}h20" stroke="{color}" stroke-width="2" stroke-dasharray="{dash}"/>"#
                )
            };
            let _ = write!(
                svg,
                r#"{line}<text x="{:.1}" y="{:.1}">{}</text>"#,
                x + 26.0,
                y + 4.0,
                escape(&series.name)
            );
        }
        svg
    }
}

impl Series {
    fn to_svg(&self, scale: &Scale) -> String {
        let color = COLORS[self.style % COLORS.len()];
        let at = |&(x, y): &(f64, f64)| (scale.x(x), scale.y(y));
        if self.points_only {
            return self
                .points
                .iter()
                .map(at)
                .map(|(x, y)| mark(x, y, color))
                .collect();
        }
        let places: Vec<String> = (self.points.iter().map(at))
            .map(|(x, y)| format!("{x:.1} {y:.1}"))
            .collect();
        format!(
            r#"<path d="M{}" fill="none" stroke="{color}" stroke-width="2" stroke-dasharray="{}"/>"#,
            places.join("L"),
            DASHES[self.style % DASHES.len()]
        )
    }
}

fn mark(x: f64, y: f64, color: &str) -> String {
    format!(r##"<circle cx="{x:.1}" cy="{y:.1}" r="3.5" fill="#fff" stroke="{color}" stroke-width="1.5"/>"##)
}

/// Where numbers lie on the plot.
#[derive(Debug)]
struct Scale {
    x_max: f64,
    y_max: f64,
    x_step: f64,
    y_step: f64,
}

impl Scale {
    fn of(plot: &Plot) -> Self {
        let largest = |axis: fn(&(f64, f64)) -> f64| {
            let values = plot
                .series
                .iter()
                .flat_map(|series| series.points.iter().map(axis));
            match values.fold(0.0, f64::max) {
                // So that one can divide by it.
                0.0 => 1.0,
                largest => largest,
            }
        };
        let (x_max, y_max) = (largest(|point| point.0), largest(|point| point.1));
        let (x_step, y_step) = (step(x_max), step(y_max));
        Self {
            x_max,
            y_max: (y_max / y_step).ceil() * y_step,
            x_step,
            y_step,
        }
    }

    fn x(&self, x: f64) -> f64 {
        LEFT + (WIDTH - LEFT - RIGHT) * x / self.x_max
    }

    fn y(&self, y: f64) -> f64 {
        HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * y / self.y_max
    }
}

/// A round distance between ticks: four to eight of them up to `max`.
fn step(max: f64) -> f64 {
    let rough = max / 5.0;
    let magnitude = 10f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|factor| factor * magnitude >= rough);
    factor.unwrap_or(10.0) * magnitude
}

fn ticks(max: f64, step: f64) -> impl Iterator<Item = f64> {
    let count = (max / step + 1e-9).floor() as u32;
    (0..=count).map(move |tick| f64::from(tick) * step)
}

fn number(value: f64, step: f64) -> String {
    let digits = (-step.log10().floor()).max(0.0) as usize;
    format!("{value:.digits$}")
}

/// Text as XML has it.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round_and_ticks_cover_the_range() {
        for (max, expected) in [
            (10.0, 2.0),
            (9.0, 2.0),
            (0.06, 0.02),
            (1_453.0, 500.0),
            (1.0, 0.2),
        ] {
            assert!((step(max) - expected).abs() < 1e-12, "{max}: {}", step(max));
        }
        assert_eq!(ticks(10.0, 2.0).count(), 6);
        assert_eq!(number(0.04, 0.02), "0.04");
    }

    #[test]
    fn a_plot_has_every_series_and_no_broken_text() {
        let svg = Plot {
            title: "A < B & C".into(),
            x_label: "seconds",
            series: vec![
                Series {
                    name: "line".into(),
                    style: 0,
                    points_only: false,
                    points: vec![(0.0, 0.0), (10.0, 5.0)],
                },
                Series {
                    name: "points".into(),
                    style: 1,
                    points_only: true,
                    points: vec![(5.0, 0.0)],
                },
            ],
        }
        .to_svg();
        assert!(svg.contains("A &lt; B &amp; C"));
        // The highest point of the line is at the top right, since 5 is a multiple of the step.
        assert!(svg.contains("M46.0 184.0L348.0 30.0"), "{svg}");
        assert_eq!(svg.matches("<circle").count(), 2);
    }
}
