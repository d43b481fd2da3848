//! What was delivered, for scripts: the JSON of `--json` and `--report`, and the metadata of the EXR.

use std::collections::BTreeMap;

use serde::Serialize;

/// All that is known of a frame. Times in seconds.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Report {
    /// Time allowed from the start of the process; `null` without a deadline.
    pub deadline_s: Option<f64>,
    /// Time from the start of the process until the files were in place.
    pub elapsed_s: f64,
    /// `deadline_s − elapsed_s`.
    pub slack_s: Option<f64>,
    /// Whether a signal ended the tracing early.
    pub interrupted: bool,
    /// By component: `direct` and `indirect`, or `full`.
    pub tasks: BTreeMap<&'static str, TaskCounts>,
    /// Share of pixels without data of their own; the mean over the open buffers (Table 1).
    pub reconstructed_percent: ReconstructedPercent,
    /// Samples of a pixel, on the average.
    pub samples_per_pixel: SamplesPerPixel,
    /// VPL sets of which any data arrived; 0 in the progressive algorithm.
    pub open_sets: u32,
    /// Open sets left out for having too little.
    pub dropped_sets: u32,
    /// Results that came too late to count.
    pub late_results: u64,
    /// Most slots that were there at a time.
    pub slots: u32,
    /// Every worker that joined, in order.
    pub workers: Vec<WorkerReport>,
    /// Rays that asked whether a light is visible.
    pub shadow_rays: u64,
    /// Rays from the eye, those of this process not counted.
    pub primary_rays: u64,
    /// Where the time went.
    pub seconds: Seconds,
    /// How the end of the tracing was chosen; `null` without a deadline.
    pub ledger: Option<LedgerReport>,
    /// Time that slots spent in tracing and shading, added up over all slots.
    pub busy_slot_seconds: f64,
    /// Seed of every random number.
    pub seed: u64,
    /// Program version and revision.
    pub version: String,
    /// What was rendered, and how.
    pub settings: SettingsReport,
    /// Files that were written.
    pub files: Vec<String>,
}

/// See [`Report::samples_per_pixel`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct SamplesPerPixel {
    /// Points of the lights.
    pub direct: f64,
    /// VPL sets.
    pub indirect: f64,
}

/// Tasks of one component; a task of several passes counts as so many.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct TaskCounts {
    /// The full workload.
    pub total: u32,
    /// Whole results.
    pub completed: u32,
    /// Results that cover a part of their pixels.
    pub partial: u32,
}

/// See [`Report::reconstructed_percent`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct ReconstructedPercent {
    /// Direct light.
    pub direct: f64,
    /// Indirect light.
    pub indirect: f64,
}

/// One worker's part.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct WorkerReport {
    /// What it calls itself.
    pub name: String,
    /// Where it is.
    pub address: String,
    /// Whether this process started it.
    pub local: bool,
    /// Tasks that it renders at a time.
    pub slots: u32,
    /// When it joined.
    pub joined_s: f64,
    /// When it was given its first task.
    pub first_task_s: Option<f64>,
    /// Results that counted; one of several passes counts as so many.
    pub tasks: u32,
    /// Rays of these.
    pub rays: u64,
    /// Time that its slots spent on these.
    pub busy_s: f64,
    /// Its last Δt.
    pub delta_t_s: f64,
    /// Bytes of the scene that were sent to it; 0 if it had the scene.
    pub scene_bytes: u64,
    /// Why it left before the end.
    pub left: Option<String>,
}

/// How the end of the tracing was chosen, and what it was based on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct LedgerReport {
    /// When the tracing was over.
    pub cut_off_s: f64,
    /// Time that the finish phase was predicted to take from then on.
    pub finish_predicted_s: f64,
    /// Margin besides.
    pub margin_s: f64,
    /// Share of a core that a thread got while others computed.
    pub cpu_share: f64,
}

/// Where the time went, by phase.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Seconds {
    /// Reading the scene, in this process.
    pub load: f64,
    /// Building the BVH, in this process.
    pub bvh: f64,
    /// From the first task handed out to the last result.
    pub tracing: f64,
    /// Assembling the picture.
    pub reconstruct: f64,
    /// Making the bytes of EXR and PNG, side by side.
    pub encode: f64,
    /// Putting the files in place.
    pub write: f64,
}

/// What was rendered, and how.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SettingsReport {
    /// The scene file.
    pub scene: String,
    /// BLAKE3 of the scene's files.
    pub scene_digest: String,
    /// `vpl` or `path`.
    pub integrator: &'static str,
    /// `progressive`, `component` or `straightforward`.
    pub algorithm: &'static str,
    /// Whether `--paper` was given.
    pub paper: bool,
    /// Flags that override a value of the paper.
    pub paper_overridden_by: Vec<&'static str>,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Pixel groups.
    pub groups: u32,
    /// Light samples per pixel.
    pub spp: u32,
    /// Virtual point lights.
    pub vpls: u32,
    /// Sets that they are divided into.
    pub vpl_sets: u32,
    /// Bound of the geometry term, in 1/(scene unit)².
    pub geometry_clamp: Option<f32>,
    /// `per_pass` or `per_pixel`.
    pub light_points: &'static str,
    /// `nearest` or `none`: what was asked for.
    pub reconstruction: &'static str,
    /// `nearest` or `none`: what there was time for.
    pub reconstruction_used: &'static str,
    /// Share of pixels under which a set is left out.
    pub min_set_percent: f32,
    /// Brightness of the PNG in stops.
    pub exposure_stops: f32,
}

impl Report {
    /// One JSON object, indented.
    pub fn to_json(&self) -> String {
        // Only a map with keys that are no text, or a writer that fails, could be refused.
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// Names and texts for the EXR.
    pub fn metadata(&self) -> Vec<(String, String)> {
        let json = serde_json::to_value(self).unwrap_or_default();
        let fields = json.as_object().into_iter().flatten();
        let texts = fields.map(|(name, value)| {
            let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            (format!("gridlight.{name}"), text)
        });
        texts.collect()
    }

    /// The line for people that ends a run.
    pub fn line(&self) -> String {
        let files = self.files.join(", ");
        let when = match self.slack_s {
            Some(slack) if slack >= 0.0 => format!("{:.0} ms before the deadline", 1e3 * slack),
            Some(slack) => format!("{:.0} ms AFTER the deadline", -1e3 * slack),
            None => format!("after {:.1} s", self.elapsed_s),
        };
        let counts = self.tasks.iter().map(|(component, counts)| {
            let TaskCounts { total, completed, .. } = counts;
            if self.settings.algorithm == "progressive" {
                return self.samples_of(component);
            }
            match self.reconstructed_percent_of(component) {
                percent if percent > 0.0 => {
                    format!("{component} {completed}/{total} ({percent:.1} % reconstructed)")
                }
                _ => format!("{component} {completed}/{total}"),
            }
        });
        let counts: Vec<String> = counts.collect();
        let separator = if counts.is_empty() { "" } else { ": " };
        format!("delivered {files} {when}{separator}{}", counts.join(", "))
    }

    fn samples_of(&self, component: &str) -> String {
        let SamplesPerPixel { direct, indirect } = self.samples_per_pixel;
        let samples = if component == "indirect" { indirect } else { direct };
        match self.reconstructed_percent_of(component) {
            percent if percent > 0.0 => {
                format!("{samples:.1} {component} passes ({percent:.1} % reconstructed)")
            }
            _ => format!("{samples:.1} {component} passes"),
        }
    }

    fn reconstructed_percent_of(&self, component: &str) -> f64 {
        match component {
            "indirect" => self.reconstructed_percent.indirect,
            _ => self.reconstructed_percent.direct,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report() -> Report {
        let counts = |completed| TaskCounts {
            total: 1024,
            completed,
            partial: 2,
        };
        Report {
            deadline_s: Some(8.0),
            elapsed_s: 7.962,
            slack_s: Some(0.038),
            tasks: [("direct", counts(1024)), ("indirect", counts(727))].into(),
            reconstructed_percent: ReconstructedPercent {
                direct: 0.0,
                indirect: 29.1,
            },
            files: vec!["render.exr".to_owned(), "render.png".to_owned()],
            ..Report::default()
        }
    }

    #[test]
    fn the_last_line_says_what_when_and_how_much() {
        let expected = "delivered render.exr, render.png 38 ms before the deadline: \
             direct 1024/1024, indirect 727/1024 (29.1 % reconstructed)";
        assert_eq!(report().line(), expected);
    }

    #[test]
    fn the_report_has_the_fields_that_scripts_rely_on() {
        let json: serde_json::Value = serde_json::from_str(&report().to_json()).unwrap();
        for path in [
            "/deadline_s",
            "/elapsed_s",
            "/slack_s",
            "/tasks/direct/total",
            "/tasks/direct/completed",
            "/tasks/indirect/partial",
            "/reconstructed_percent/direct",
            "/reconstructed_percent/indirect",
            "/open_sets",
            "/dropped_sets",
            "/late_results",
            "/slots",
            "/workers",
            "/shadow_rays",
            "/primary_rays",
            "/seconds/load",
            "/seconds/bvh",
            "/seconds/tracing",
            "/seconds/reconstruct",
            "/seconds/encode",
            "/seconds/write",
            "/seed",
            "/version",
        ] {
            assert!(json.pointer(path).is_some(), "{path} is missing");
        }
    }

    #[test]
    fn the_metadata_names_every_field() {
        let metadata = report().metadata();
        let value = |name: &str| metadata.iter().find(|(n, _)| n == name).map(|(_, v)| v.as_str());
        assert_eq!(value("gridlight.seed"), Some("0"));
        assert_eq!(value("gridlight.deadline_s"), Some("8.0"));
    }
}
