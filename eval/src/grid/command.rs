//! `eval grid`: one frame on the virtual grid.

use std::{fs::File, io::BufWriter, path::PathBuf, time::Duration};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use render::{
    image::{Picture, write_exr, write_png},
    scene::ImageSize,
    settings::Algorithm,
    task::Component,
};
use serde::Serialize;

use super::{
    frame::PreparedScene,
    parameters::{Parameters, SceneParameters},
    places,
    script::Script,
    simulate::{Circumstances, Run, simulate},
};

/// Speed of a core in a scene of which the parameters say nothing, rays per second.
const CORE_RAYS_PER_S: f64 = 250e3;

/// The flags of `eval grid`.
#[derive(Debug, Args)]
pub struct GridArgs {
    /// A .toml scene file, or a bare .obj
    #[arg(long, value_name = "FILE")]
    scene: PathBuf,
    /// When the last result counts, in simulated seconds
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    deadline: Duration,
    /// How the work is divided into tasks
    #[arg(long, value_name = "NAME", value_enum, default_value_t = AlgorithmName::Component)]
    algorithm: AlgorithmName,
    /// Machines that come and go: a TOML file with `machines = N` and a `[[change]]` with `at_s` and
    /// `join` or `leave` for each change
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
    /// Another grid: a TOML file of the form of eval/paper.toml
    #[arg(long, value_name = "FILE")]
    parameters: Option<PathBuf>,
    /// Size of the picture [default: that of the parameters]; tasks take as long as at that one
    #[arg(long, value_name = "WxH", value_parser = image_size)]
    size: Option<ImageSize>,
    /// Rays per second of one core, at the size of the parameters [default: as they say for the scene,
    /// else 250000]
    #[arg(long, value_name = "RAYS", value_parser = rays_per_second)]
    core_speed: Option<f64>,
    /// Another seed for the moments of first requests and the speeds of cores
    #[arg(long, value_name = "NUMBER")]
    seed: Option<u64>,
    /// The folder of scenes that are not in this repository [default: `$GRIDLIGHT_SCENES`, else
    /// ../shared/scenes]
    #[arg(long, value_name = "DIR")]
    scenes: Option<PathBuf>,
    /// Picture: .png or .exr
    #[arg(long, value_name = "FILE", default_value = "grid.png")]
    out: PathBuf,
    /// One JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// See [`Algorithm`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum AlgorithmName {
    /// Direct and indirect light are tasks of their own (section 3.2 of the paper)
    Component,
    /// A task is all light of its pixels (section 3.1)
    Straightforward,
}

impl From<AlgorithmName> for Algorithm {
    fn from(name: AlgorithmName) -> Self {
        match name {
            AlgorithmName::Component => Self::Component,
            AlgorithmName::Straightforward => Self::Straightforward,
        }
    }
}

/// Renders the frame, writes its picture and tells what was done.
pub fn run(args: &GridArgs) -> anyhow::Result<String> {
    let format = Format::of(args)?;
    let mut parameters = Parameters::load(args.parameters.as_deref())?;
    if let Some(seed) = args.seed {
        parameters.grid.seed = seed;
    }
    let known = scene_parameters(&parameters, args).cloned();
    let mut core_rays_per_s = args
        .core_speed
        .or(known.as_ref().map(|scene| scene.core_rays_per_s))
        .unwrap_or(CORE_RAYS_PER_S);
    if let Some(size) = args.size {
        let scaled = parameters.at_size(size);
        core_rays_per_s *= size.pixel_count() as f64 / parameters.size().pixel_count() as f64;
        parameters = scaled;
    }
    let script = match &args.script {
        Some(path) => Script::load(path)?,
        None => Script::default(),
    };

    let scenes_dir = places::shared_scenes(args.scenes.as_deref());
    let scene = PreparedScene::load(&args.scene, &scenes_dir, &parameters)?;
    let frame = scene.frame(args.algorithm.into())?;
    let circumstances = Circumstances {
        grid: &parameters.grid,
        network: &parameters.network,
        core_rays_per_s,
        script: &script,
        deadline: Some(args.deadline),
    };
    let run = simulate(&circumstances, frame.settings(), &frame);
    let picture = frame.picture(run.results.iter().map(|result| (result.task, result.pixels)))?;
    let exposure_stops = known.map_or(0.0, |scene| scene.exposure_stops) as f32;
    write(&picture, exposure_stops, format, args)
        .with_context(|| format!("cannot write {}", args.out.display()))?;

    let report = Report::new(args, &run, &picture, core_rays_per_s, parameters.grid.seed);
    Ok(if args.json {
        serde_json::to_string_pretty(&report)?
    } else {
        report.to_table()
    })
}

/// The parameters' scene with the same file name.
fn scene_parameters<'a>(parameters: &'a Parameters, args: &GridArgs) -> Option<&'a SceneParameters> {
    let name = args.scene.file_name()?.to_str()?;
    parameters.scene.iter().find(|scene| scene.file == name)
}

#[derive(Debug, Clone, Copy)]
enum Format {
    Exr,
    Png,
}

impl Format {
    fn of(args: &GridArgs) -> anyhow::Result<Self> {
        match args.out.extension().and_then(|extension| extension.to_str()) {
            Some("exr") => Ok(Self::Exr),
            Some("png") => Ok(Self::Png),
            _ => bail!("--out {}: end the name in .png or .exr", args.out.display()),
        }
    }
}

fn write(picture: &Picture, exposure_stops: f32, format: Format, args: &GridArgs) -> anyhow::Result<()> {
    let mut file = BufWriter::new(File::create(&args.out)?);
    match format {
        Format::Exr => write_exr(picture, &[], &mut file)?,
        Format::Png => write_png(picture, exposure_stops, &mut file)?,
    }
    file.into_inner()?.sync_all()?;
    Ok(())
}

/// What was done.
#[derive(Debug, Serialize)]
struct Report {
    scene: String,
    algorithm: String,
    deadline_s: f64,
    core_rays_per_s: f64,
    seed: u64,
    tasks: Vec<TaskReport>,
    direct_reconstructed_percent: f64,
    indirect_reconstructed_percent: f64,
    late_results: u64,
    closed_at_s: Option<f64>,
    picture: String,
}

#[derive(Debug, Serialize)]
struct TaskReport {
    component: &'static str,
    total: u32,
    issued: u32,
    completed: u32,
    partial: u32,
}

impl Report {
    fn new(args: &GridArgs, run: &Run, picture: &Picture, core_rays_per_s: f64, seed: u64) -> Self {
        let tasks = run.tallies.iter().map(|(component, tally)| TaskReport {
            component: match component {
                Component::Direct => "direct",
                Component::Indirect => "indirect",
                Component::Full => "full",
            },
            total: tally.total,
            issued: tally.issued,
            completed: tally.completed,
            partial: tally.partial,
        });
        Self {
            scene: args.scene.display().to_string(),
            algorithm: format!("{:?}", args.algorithm).to_lowercase(),
            deadline_s: args.deadline.as_secs_f64(),
            core_rays_per_s,
            seed,
            tasks: tasks.collect(),
            direct_reconstructed_percent: picture.coverage.direct_reconstructed_percent,
            indirect_reconstructed_percent: picture.coverage.indirect_reconstructed_percent,
            late_results: run.late,
            closed_at_s: run.closed.map(|(at, _)| at.as_secs_f64()),
            picture: args.out.display().to_string(),
        }
    }

    fn to_table(&self) -> String {
        let tasks = self.tasks.iter().map(|tasks| {
            format!(
                "{:<9} {:>5} of {:>5} tasks completed, {} partly, {} handed out\n",
                tasks.component, tasks.completed, tasks.total, tasks.partial, tasks.issued
            )
        });
        format!(
            "{}reconstructed: direct {:.2} %, indirect {:.2} %; {} results late\n{}",
            tasks.collect::<String>(),
            self.direct_reconstructed_percent,
            self.indirect_reconstructed_percent,
            self.late_results,
            self.picture
        )
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.0..=86_400.0).contains(&seconds) => Ok(Duration::from_secs_f64(seconds)),
        _ => Err("need a number of seconds from 0 to 86400".into()),
    }
}

fn rays_per_second(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rays) if (1.0..=1e12).contains(&rays) => Ok(rays),
        _ => Err("need a number from 1 to 1e12".into()),
    }
}

fn image_size(text: &str) -> Result<ImageSize, String> {
    let sides = text.split_once('x');
    let size = sides.and_then(|(width, height)| {
        Some(ImageSize {
            width: width.parse().ok()?,
            height: height.parse().ok()?,
        })
    });
    size.filter(|size| size.is_valid())
        .ok_or_else(|| "a size is written as WIDTHxHEIGHT, such as 1024x768".into())
}
