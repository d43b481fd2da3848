//! `eval realtime`: both algorithms by the clock, with the `master` program on this machine.

use std::{
    env, fs,
    io::Write,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use anyhow::{Context, bail};
use clap::Args;
use serde::Deserialize;

use super::{
    command::find,
    document::{Block, Document, Table},
    experiment::ALGORITHMS,
    judge::{FLIP, METRICS, Scores, VDP, judge},
};
use crate::{
    grid::{
        parameters::{Parameters, SceneParameters},
        places,
    },
    image::ImageRgb,
    image_io,
};

/// The flags of `eval realtime`.
#[derive(Debug, Args)]
pub struct RealtimeArgs {
    /// The folder of scenes that are not in this repository [default: `$GRIDLIGHT_SCENES`, else
    /// ../shared/scenes]
    #[arg(long, value_name = "DIR")]
    scenes: Option<PathBuf>,
    /// Leave out scenes that are not there instead of refusing to begin
    #[arg(long)]
    allow_missing: bool,
    /// Deadlines in seconds
    #[arg(long, value_name = "S,S,…", value_delimiter = ',', default_value = "1,2,4,8")]
    deadlines: Vec<f64>,
    /// Runs of each deadline and algorithm
    #[arg(long, value_name = "COUNT", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
    /// Size of the pictures
    #[arg(long, value_name = "WxH", default_value = "1024x768")]
    size: String,
    /// Light samples per pixel; with more than the paper's 16, and more VPLs than its 256, the deadline
    /// bites on faster machines than the paper's
    #[arg(long, value_name = "COUNT", default_value_t = 64)]
    spp: u32,
    /// Virtual point lights, in sets of 16 as in the paper
    #[arg(long, value_name = "COUNT", default_value_t = 1024)]
    vpls: u32,
    /// The program to run [default: `master` beside this program, else `cargo run -p master`]
    #[arg(long, value_name = "FILE")]
    master: Option<PathBuf>,
    /// Where the page goes
    #[arg(long, value_name = "FILE", default_value = "docs/paper/realtime.md")]
    out: PathBuf,
}

/// VPLs in each set, as in the paper.
const VPLS_PER_SET: u32 = 16;

/// Runs everything, writes the page, and tells where it is.
pub fn run(args: &RealtimeArgs) -> anyhow::Result<String> {
    let parameters = Parameters::load(None)?;
    let scenes_dir = places::shared_scenes(args.scenes.as_deref());
    let (found, missing) = find(&parameters.scene, &scenes_dir)?;
    if !missing.is_empty() && (found.is_empty() || !args.allow_missing) {
        bail!(
            "{} not found in {}; see scenes/README.md, or pass --allow-missing to go on with the others",
            missing.join(", "),
            scenes_dir.display()
        );
    }
    let bench = Bench {
        args,
        scenes_dir: &scenes_dir,
        folder: tempfile::tempdir().context("cannot make a temporary folder")?,
    };
    let mut rows = Vec::new();
    for (scene, file) in found {
        rows.extend(bench.scene(scene, &file)?);
    }
    let page = page(args, rows).to_markdown();
    if let Some(folder) = args.out.parent() {
        fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    }
    fs::write(&args.out, page).with_context(|| format!("cannot write {}", args.out.display()))?;
    Ok(args.out.display().to_string())
}

/// The part of the master's report that counts here.
#[derive(Debug, Deserialize)]
struct MasterReport {
    elapsed_s: f64,
    reconstructed_percent: Reconstructed,
}

#[derive(Debug, Deserialize)]
struct Reconstructed {
    direct: f64,
    indirect: f64,
}

struct Bench<'a> {
    args: &'a RealtimeArgs,
    scenes_dir: &'a Path,
    folder: tempfile::TempDir,
}

/// One delivered picture.
struct Delivered {
    report: MasterReport,
    scores: Scores,
}

impl Bench<'_> {
    /// A row for each algorithm and deadline.
    fn scene(&self, scene: &SceneParameters, file: &Path) -> anyhow::Result<Vec<Vec<String>>> {
        tell(&format!("{}: the picture without a deadline", scene.name));
        let (_, gold) = self.render(file, &["--no-deadline".into(), "--algorithm=component".into()])?;
        let mut rows = Vec::new();
        for &deadline_s in &self.args.deadlines {
            for algorithm in ALGORITHMS {
                let name = format!("{algorithm:?}").to_lowercase();
                tell(&format!("{}: {name}, {deadline_s} s", scene.name));
                let flags = [format!("--deadline={deadline_s}"), format!("--algorithm={name}")];
                let runs = (0..self.args.runs)
                    .map(|_| {
                        let (report, image) = self.render(file, &flags)?;
                        let scores = judge(&gold, &image, scene.exposure_stops)?.scores;
                        Ok(Delivered { report, scores })
                    })
                    .collect::<anyhow::Result<Vec<_>>>()?;
                let mut row = vec![format!("{}, {deadline_s} s, {name}", scene.name)];
                row.extend(cells(&runs));
                rows.push(row);
            }
        }
        Ok(rows)
    }

    /// Lets the master make a picture and reads it back.
    fn render(&self, scene: &Path, flags: &[String]) -> anyhow::Result<(MasterReport, ImageRgb)> {
        let out = self.folder.path().join("picture.exr");
        let args = self.args;
        let mut command = master(args.master.as_deref());
        command
            .args(["--paper", "--no-png", "--quiet", "--json"])
            .arg(format!("--size={}", args.size))
            .arg(format!("--spp={}", args.spp))
            .arg(format!("--vpls={}", args.vpls))
            .arg(format!("--vpl-sets={}", args.vpls / VPLS_PER_SET))
            .args(flags)
            .arg("--scene")
            .arg(scene)
            .arg("--out")
            .arg(&out)
            .env("GRIDLIGHT_SCENES", self.scenes_dir)
            .stderr(Stdio::inherit());
        let output = command
            .output()
            .with_context(|| format!("cannot start {}", command.get_program().display()))?;
        if !output.status.success() {
            bail!("{} ended with {}", command.get_program().display(), output.status);
        }
        let report = serde_json::from_slice(&output.stdout)
            .context("the master's report is not what this program knows; build both from one revision")?;
        Ok((report, image_io::read(&out, None)?))
    }
}

/// The program beside this one, or Cargo, which builds it.
fn master(given: Option<&Path>) -> Command {
    if let Some(program) = given {
        return Command::new(program);
    }
    let name = format!("master{}", env::consts::EXE_SUFFIX);
    let beside = env::current_exe()
        .ok()
        .map(|program| program.with_file_name(name));
    if let Some(program) = beside.filter(|program| program.is_file()) {
        return Command::new(program);
    }
    let mut cargo = Command::new("cargo");
    cargo.args(["run", "--quiet", "-p", "master", "--"]);
    cargo
}

fn cells(runs: &[Delivered]) -> Vec<String> {
    let summary = |value: &dyn Fn(&Delivered) -> f64, format: &dyn Fn(f64) -> String| {
        let mut values: Vec<f64> = runs.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        let [first, .., last] = values[..] else {
            return values.first().map_or_else(String::new, |&value| format(value));
        };
        format!(
            "{} ({} to {})",
            format(median(&values)),
            format(first),
            format(last)
        )
    };
    let metric = |place: usize| summary(&|run| run.scores.0[place], &|value| METRICS[place].format(value));
    let plain = |digits: usize| move |value: f64| format!("{value:.digits$}");
    vec![
        summary(&|run| run.report.elapsed_s, &plain(3)),
        summary(&|run| run.report.reconstructed_percent.direct, &plain(1)),
        summary(&|run| run.report.reconstructed_percent.indirect, &plain(1)),
        metric(VDP),
        metric(FLIP),
        metric(FLIP + 1),
    ]
}

/// Of ascending values, at least one.
fn median(values: &[f64]) -> f64 {
    let middle = values.len() / 2;
    if values.len().is_multiple_of(2) {
        f64::midpoint(values[middle - 1], values[middle])
    } else {
        values[middle]
    }
}

fn page(args: &RealtimeArgs, rows: Vec<Vec<String>>) -> Document {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let header = [
        "Row",
        "Delivered after, s",
        "Direct reconstructed, %",
        "Indirect reconstructed, %",
        METRICS[VDP].name,
        METRICS[FLIP].name,
        METRICS[FLIP + 1].name,
    ];
    Document {
        title: "Both algorithms by the clock".into(),
        blocks: vec![
            Block::Text(format!(
                "Nothing is simulated here: the `master` program with its local worker, on {cores} cores, at \
                 {}. With {} light samples per pixel and {} VPLs in sets of {VPLS_PER_SET}, otherwise as \
                 `master --paper`, so that the deadline bites. Each cell is the median of {} runs, with the \
                 range; made by `cargo run -p eval -- realtime`. Times depend on the machine and its load, so \
                 this page is not the same twice.",
                args.size, args.spp, args.vpls, args.runs
            )),
            Block::Table(Table {
                caption: "Distance from the picture without a deadline".into(),
                header: header.map(str::to_owned).to_vec(),
                rows,
            }),
        ],
    }
}

/// Progress, for people; where stderr is closed there are none.
fn tell(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn delivered(elapsed_s: f64) -> Delivered {
        Delivered {
            report: MasterReport {
                elapsed_s,
                reconstructed_percent: Reconstructed {
                    direct: 0.0,
                    indirect: 50.0,
                },
            },
            scores: Scores([elapsed_s; METRICS.len()]),
        }
    }

    #[test]
    fn a_cell_is_the_median_with_the_range() {
        let runs = [3.0, 1.0, 2.0].map(delivered);
        let cells = cells(&runs);
        assert_eq!(cells[0], "2.000 (1.000 to 3.000)");
        assert_eq!(cells[3], "2.00 (1.00 to 3.00)");
        assert!((median(&[1.0, 2.0, 4.0, 5.0]) - 3.0).abs() < 1e-12);
    }
}
