//! `eval realtime`: both algorithms by the clock, with the `master` program on this machine.

pub mod measured;
pub mod page;

use std::{
    env, fs,
    io::Write,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    thread,
};

use anyhow::{Context, bail};
use clap::Args;
use serde::Deserialize;

use self::measured::{Case, Measured, OneRun, by_name, name};
use super::{command::find, document::Document, experiment::ALGORITHMS, judge::judge};
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
    /// Only this scene, as the page calls it, such as "Sibenik"
    #[arg(long, value_name = "NAME")]
    scene: Option<String>,
    /// Deadlines in seconds
    #[arg(long, value_name = "S,S,…", value_delimiter = ',', default_value = "1,2,4,8", value_parser = seconds)]
    deadlines: Vec<f64>,
    /// Runs of each deadline and algorithm
    #[arg(long, value_name = "COUNT", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
    /// Size of the pictures
    #[arg(long, value_name = "WxH", default_value = "1024x768")]
    size: String,
    /// Light samples per pixel; the default is the paper's, and takes two cores of today longer than these
    /// deadlines; where it does not, ask for more
    #[arg(long, value_name = "COUNT", default_value_t = 16)]
    spp: u32,
    /// Virtual point lights, in sets of 16 as in the paper
    #[arg(long, value_name = "COUNT", default_value_t = 256, value_parser = clap::value_parser!(u32).range(16..))]
    vpls: u32,
    /// The program to run [default: `master` beside this program, else `cargo run -p master`]
    #[arg(long, value_name = "FILE")]
    master: Option<PathBuf>,
    /// The folder of the page: results go into realtime.json there, and into paper.html and README.md
    /// if these are there already [default: docs/paper]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// VPLs in each set, as in the paper.
const VPLS_PER_SET: u32 = 16;
/// Starting, reading back and judging, in seconds: for the estimate of the time that is left.
const BESIDES_S: f64 = 3.0;
/// The master's exit code for a picture that came late. It is there, and its time is a result like others.
const DEADLINE_MISSED: i32 = 6;
/// A picture without a deadline, in seconds: for the same.
const GOLD_S: f64 = 30.0;

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds.is_finite() => Ok(seconds),
        _ => Err("need a number of seconds above 0".into()),
    }
}

/// Runs everything, keeps the results, puts them into the page, and tells where they are.
pub fn run(args: &RealtimeArgs) -> anyhow::Result<String> {
    let mut parameters = Parameters::load(None)?;
    select(args.scene.as_deref(), &mut parameters.scene)?;
    let scenes_dir = places::shared_scenes(args.scenes.as_deref());
    let (found, missing) = find(&parameters.scene, &scenes_dir)?;
    if !missing.is_empty() && (found.is_empty() || !args.allow_missing) {
        bail!(
            "{} not found in {}; see scenes/README.md, or pass --allow-missing to go on with the others",
            missing.join(", "),
            scenes_dir.display()
        );
    }
    let out = args
        .out
        .clone()
        .unwrap_or_else(|| places::project_root().join("docs/paper"));
    fs::create_dir_all(&out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    let mut bench = Bench {
        args,
        scenes_dir: &scenes_dir,
        out: &out,
        folder: tempfile::tempdir().context("cannot make a temporary folder")?,
        left_s: found.len() as f64 * scene_s(args),
        measured: empty(args),
    };
    for (scene, file) in found {
        bench.scene(scene, &file)?;
    }
    put_into_page(&bench.measured, &out)
}

/// Keeps only the scene that is asked for.
fn select(name: Option<&str>, scenes: &mut Vec<SceneParameters>) -> anyhow::Result<()> {
    let Some(name) = name else {
        return Ok(());
    };
    let known: Vec<String> = scenes.iter().map(|scene| scene.name.clone()).collect();
    scenes.retain(|scene| scene.name == name);
    if scenes.is_empty() {
        bail!(
            "there is no scene {name:?}; --scene takes one of: {}",
            known.join(", ")
        );
    }
    Ok(())
}

/// About how long one scene takes.
fn scene_s(args: &RealtimeArgs) -> f64 {
    let each = |deadline_s: &f64| f64::from(args.runs) * (deadline_s + BESIDES_S);
    GOLD_S + ALGORITHMS.len() as f64 * args.deadlines.iter().map(each).sum::<f64>()
}

fn empty(args: &RealtimeArgs) -> Measured {
    Measured {
        version: "unknown".into(),
        processor: processor(),
        cores: thread::available_parallelism().map_or(1, usize::from),
        size: args.size.clone(),
        spp: args.spp,
        vpls: args.vpls,
        vpl_sets: args.vpls / VPLS_PER_SET,
        cases: Vec::new(),
    }
}

/// What the system calls the processor.
fn processor() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let mut lines = text.lines();
    let model = lines.find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    model.map_or("an unknown processor".into(), |(_, model)| {
        model.trim().to_owned()
    })
}

/// One of the two forms of a document.
type Render = fn(&Document) -> String;

/// Writes the part of the page into the files that are there.
fn put_into_page(measured: &Measured, out: &Path) -> anyhow::Result<String> {
    let block = page::part(Some(measured));
    let document = Document {
        title: String::new(),
        blocks: vec![block],
    };
    let write = |path: &Path, bytes: &[u8]| {
        fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
    };
    for figure in document.figures() {
        write(&out.join(&figure.file), &figure.bytes)?;
    }
    let json = out.join(measured::FILE).display().to_string();
    let renders: [(&str, Render); 2] = [
        ("paper.html", Document::to_html),
        ("README.md", Document::to_markdown),
    ];
    for (name, render) in renders {
        let path = out.join(name);
        let Ok(text) = fs::read_to_string(&path) else {
            return Ok(format!(
                "{json} (no {name} there yet: `eval paper` will take it in)"
            ));
        };
        let Some(text) = page::insert(&text, measured, render) else {
            bail!(
                "{} has no place for this; {json} is kept, so run `eval paper` to make the page anew",
                path.display()
            );
        };
        write(&path, text.as_bytes())?;
    }
    Ok(format!("{json}, and in {}", out.join("paper.html").display()))
}

/// The part of the master's report that counts here.
#[derive(Debug, Deserialize)]
struct MasterReport {
    elapsed_s: f64,
    reconstructed_percent: Reconstructed,
    version: String,
}

#[derive(Debug, Deserialize)]
struct Reconstructed {
    direct: f64,
    indirect: f64,
}

struct Bench<'a> {
    args: &'a RealtimeArgs,
    scenes_dir: &'a Path,
    out: &'a Path,
    folder: tempfile::TempDir,
    /// About how long the rest takes.
    left_s: f64,
    measured: Measured,
}

impl Bench<'_> {
    /// A case for each algorithm and deadline; each is kept at once, so that an interruption costs
    /// no more than the case that it meets.
    fn scene(&mut self, scene: &SceneParameters, file: &Path) -> anyhow::Result<()> {
        self.tell(&format!("{}: the picture without a deadline", scene.name));
        let (report, gold) = self.render(file, &["--no-deadline".into(), "--algorithm=component".into()])?;
        self.measured.version = report.version;
        self.left_s -= GOLD_S;
        for &deadline_s in &self.args.deadlines {
            for algorithm in ALGORITHMS {
                let flags = [
                    format!("--deadline={deadline_s}"),
                    format!("--algorithm={}", name(algorithm)),
                ];
                let mut runs = Vec::new();
                for number in 1..=self.args.runs {
                    self.tell(&format!(
                        "{}: {}, {deadline_s} s, run {number} of {}",
                        scene.name,
                        name(algorithm),
                        self.args.runs
                    ));
                    let (report, image) = self.render(file, &flags)?;
                    runs.push(OneRun {
                        elapsed_s: report.elapsed_s,
                        reconstructed_percent: [
                            report.reconstructed_percent.direct,
                            report.reconstructed_percent.indirect,
                        ],
                        scores: by_name(&judge(&gold, &image, scene.exposure_stops)?.scores),
                    });
                    self.left_s -= deadline_s + BESIDES_S;
                }
                self.measured.cases.push(Case {
                    scene: scene.name.clone(),
                    deadline_s,
                    algorithm: name(algorithm).into(),
                    runs,
                });
                self.measured.save(self.out)?;
            }
        }
        Ok(())
    }

    /// Progress, for people; where stderr is closed there are none.
    fn tell(&self, step: &str) {
        let minutes = (self.left_s / 60.0).ceil().max(1.0);
        let _ = writeln!(std::io::stderr(), "{step}; about {minutes} min left");
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
        if !output.status.success() && output.status.code() != Some(DEADLINE_MISSED) {
            bail!(
                "{} {} ended with {}; what was measured before is in {}",
                command.get_program().display(),
                flags.join(" "),
                output.status,
                self.out.join(measured::FILE).display()
            );
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_that_is_not_known_is_answered_with_those_that_are() {
        let mut scenes = Parameters::load(None).unwrap().scene;
        select(Some("Sibenik"), &mut scenes).unwrap();
        assert_eq!(scenes.len(), 1);
        let error = select(Some("Sponza"), &mut scenes).unwrap_err().to_string();
        assert!(error.contains("one of: Sibenik"), "{error}");
    }

    #[test]
    fn results_are_kept_though_there_is_no_page_yet_and_go_into_one_that_is_there() {
        let folder = tempfile::tempdir().unwrap();
        let measured = measured::tests::measured();
        let told = put_into_page(&measured, folder.path()).unwrap();
        assert!(told.contains("no paper.html there yet"), "{told}");
        let page = Document {
            title: "Page".into(),
            blocks: vec![page::part(None)],
        };
        fs::write(folder.path().join("paper.html"), page.to_html()).unwrap();
        fs::write(folder.path().join("README.md"), page.to_markdown()).unwrap();
        put_into_page(&measured, folder.path()).unwrap();
        for name in ["paper.html", "README.md"] {
            let text = fs::read_to_string(folder.path().join(name)).unwrap();
            assert!(text.contains("1 of 2"), "{text}");
        }
        assert!(folder.path().join("realtime-sibenik-vdp.svg").is_file());
    }
}
