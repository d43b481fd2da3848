//! The command line: every flag with its unit and default, refused at the edge if it makes no sense.

use std::{
    net::{SocketAddr, ToSocketAddrs},
    num::NonZeroUsize,
    path::PathBuf,
    time::Duration,
};

use clap::{Args, Parser, Subcommand, ValueEnum};
use protocol::radiance::Encoding;
use render::{reconstruct::Reconstruction, scene::ImageSize};

/// What `--version` prints.
pub const VERSION: &str = concat!(env!("GRIDLIGHT_VERSION"), " (", env!("GRIDLIGHT_REVISION"), ")");

/// The whole command line of the `master` program.
#[derive(Debug, Parser)]
#[command(
    name = "master",
    version = VERSION,
    about = "Renders a picture by its deadline, with whatever workers there are",
    long_about = "Renders a picture by its deadline, with whatever workers there are.\n\n\
        The deadline counts from the start of this process and holds for the finished files. \
        What could not be traced in time is reconstructed.",
    after_long_help = crate::exit::TABLE,
    args_conflicts_with_subcommands = true,
    allow_negative_numbers = true
)]
pub struct Cli {
    /// Something else than rendering a picture.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// How to render a picture.
    #[command(flatten)]
    pub render: RenderArgs,
}

/// What the program does when it does not render a picture.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Gives a scene to the workers that come, so that the next frame of it begins at once.
    Warm(WarmArgs),
    /// Makes the key of a grid: a file to be copied to all its machines and named by --key
    Keygen(KeygenArgs),
    /// Renders tasks for the master that started it on the same machine.
    #[command(hide = true)]
    Worker(LocalWorkerArgs),
}

/// The flags of `warm`.
#[derive(Debug, Clone, Args)]
pub struct WarmArgs {
    /// Scene: a .toml scene file, or a bare .obj [default: the Cornell box]
    #[arg(long, value_name = "FILE")]
    pub scene: Option<PathBuf>,
    /// Address for workers to connect to
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:7420", value_parser = listen)]
    pub listen: SocketAddr,
    /// How long to wait for workers, in seconds
    #[arg(long, value_name = "SECONDS", default_value = "10", value_parser = seconds)]
    pub wait: Duration,
    /// End as soon as so many workers have the scene
    #[arg(long, value_name = "COUNT")]
    pub expect_workers: Option<usize>,
    /// Who may come.
    #[command(flatten)]
    pub key: KeyArgs,
}

/// The flags that say who may join.
#[derive(Debug, Clone, Args)]
pub struct KeyArgs {
    /// Key file: only workers that have the same key may join [make one with `master keygen`]
    #[arg(long, value_name = "FILE", env = "GRIDLIGHT_KEY", help_heading = "Workers")]
    pub key: Option<PathBuf>,

    /// Let anybody join who reaches an address of --listen that other machines can reach: no key,
    /// nothing encrypted
    #[arg(long, help_heading = "Workers")]
    pub insecure: bool,
}

/// The flags of `keygen`.
#[derive(Debug, Args)]
pub struct KeygenArgs {
    /// The new file; one that exists is left alone
    #[arg(long, value_name = "FILE", default_value = "gridlight.key")]
    pub out: PathBuf,
}

/// The flags that a master gives to the worker it starts.
#[derive(Debug, Clone, Copy, Args)]
pub struct LocalWorkerArgs {
    /// Where the master listens
    #[arg(long)]
    pub connect: SocketAddr,
    /// Tasks rendered at a time
    #[arg(long)]
    pub slots: u32,
}

/// The flags of a picture. `None` means that the flag was not given.
#[derive(Debug, Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a switch of its own on the command line"
)]
pub struct RenderArgs {
    /// Time until the finished picture is on disk, in seconds from the start of this process;
    /// from 0.1 to 86400, fractions allowed
    #[arg(long, value_name = "SECONDS", default_value = "8", value_parser = deadline)]
    pub deadline: Duration,

    /// Render the full workload, however long that takes: the gold image
    #[arg(long, conflicts_with = "deadline")]
    pub no_deadline: bool,

    /// Scene: a .toml scene file, or a bare .obj for which a camera and a light are chosen
    /// [default: the Cornell box]
    #[arg(long, value_name = "FILE", help_heading = "Scene and picture")]
    pub scene: Option<PathBuf>,

    /// Picture: .exr for a multi-layer EXR with a PNG of the same name beside it, .png for a PNG alone
    #[arg(
        long,
        value_name = "FILE",
        default_value = "render.exr",
        help_heading = "Scene and picture"
    )]
    pub out: PathBuf,

    /// Write no PNG beside the EXR
    #[arg(long, help_heading = "Scene and picture")]
    pub no_png: bool,

    /// Size of the picture in pixels [default: the scene's; with --paper 1024x768]
    #[arg(long, value_name = "WxH", value_parser = image_size, allow_hyphen_values = true, help_heading = "Scene and picture")]
    pub size: Option<ImageSize>,

    /// Brightness of the PNG, in stops: each doubles the light
    #[arg(
        long,
        value_name = "STOPS",
        default_value_t = 0.0,
        value_parser = finite,
        help_heading = "Scene and picture"
    )]
    pub exposure: f32,

    /// How the work is divided into tasks [default: progressive; with --paper component]
    #[arg(long, value_name = "NAME", help_heading = "Work")]
    pub algorithm: Option<AlgorithmName>,

    /// Exactly the paper's renderer and parameters; other flags still override single values, and the
    /// report says which
    #[arg(long, conflicts_with = "integrator", help_heading = "Work")]
    pub paper: bool,

    /// Pixel groups; a task covers one [default: 16; component: 64; straightforward: 2048]
    #[arg(long, value_name = "COUNT", help_heading = "Work")]
    pub groups: Option<u32>,

    /// Light samples per pixel: passes of direct light [default: 16; --integrator path: 256 paths].
    /// Progressive: passes of direct and of indirect light after which the work is done [default: without
    /// end; with --no-deadline 64]
    #[arg(long, value_name = "COUNT", help_heading = "Work")]
    pub spp: Option<u32>,

    /// Virtual point lights in all sets together [default: 256; progressive: 16 in each set]
    #[arg(long, value_name = "COUNT", help_heading = "Work")]
    pub vpls: Option<u32>,

    /// Sets into which the virtual point lights are divided [default: 16; progressive: the longer the
    /// deadline the more, up to 4096]
    #[arg(long, value_name = "COUNT", help_heading = "Work")]
    pub vpl_sets: Option<u32>,

    /// Seed of every random number [default: 0]
    #[arg(long, value_name = "NUMBER", help_heading = "Work")]
    pub seed: Option<u64>,

    /// Upper bound of the geometry term of virtual point lights, in 1/(scene unit)²; `none` for no
    /// bound; `auto` bounds it for a distance of 1/20 of the scene's size [default: auto]
    #[arg(long, value_name = "BOUND", value_parser = clamp, help_heading = "Work")]
    pub clamp: Option<Clamp>,

    /// `vpl` traces tasks on the workers; `path` is the reference, a path tracer in this process that
    /// needs --no-deadline
    #[arg(
        long,
        value_name = "NAME",
        requires_if("path", "no_deadline"),
        help_heading = "Work"
    )]
    pub integrator: Option<Integrator>,

    /// How the picture is made of what has come [default: guided, for deadlines of less than 2 s at
    /// 1024x768 quick or nearest; --paper and its algorithms: nearest]
    #[arg(long, value_name = "NAME", help_heading = "Work")]
    pub reconstruction: Option<ReconstructionName>,

    /// A set of virtual point lights with less than this share of its pixels is left out while others
    /// have more, in percent [default: 25]
    #[arg(long, value_name = "PERCENT", value_parser = percent, help_heading = "Work")]
    pub min_set_percent: Option<f32>,

    /// How long before the cut-off a worker sends what it has, in seconds; `auto` measures it for each
    /// worker
    #[arg(long, value_name = "SECONDS", default_value = "auto", value_parser = delta_t, help_heading = "Workers")]
    pub delta_t: Auto<Duration>,

    /// Address for workers to connect to; port 0 is any free one
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:0", value_parser = listen, help_heading = "Workers")]
    pub listen: SocketAddr,

    /// Who may join.
    #[command(flatten)]
    pub key: KeyArgs,

    /// Tasks rendered at a time on this machine; `auto` is one for each core, 0 leaves all to remote
    /// workers
    #[arg(long, value_name = "COUNT", default_value = "auto", value_parser = slots, help_heading = "Workers")]
    pub local_slots: Auto<u32>,

    /// How results come back: `exact` in 12 bytes a pixel, `half` in 6, `shared-exponent` in 4. For the same
    /// bits whoever renders, name one [default: exact from this machine and without a deadline, else
    /// shared-exponent]
    #[arg(long, value_name = "NAME", help_heading = "Workers")]
    pub pixels: Option<PixelsName>,

    /// Print the report as one JSON object on standard output
    #[arg(long, help_heading = "Output")]
    pub json: bool,

    /// Write the report as JSON to this file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub report: Option<PathBuf>,

    /// Say only what went wrong
    #[arg(short, long, conflicts_with = "verbose", help_heading = "Output")]
    pub quiet: bool,

    /// Say more; -vv says everything
    #[arg(short, long, action = clap::ArgAction::Count, help_heading = "Output")]
    pub verbose: u8,
}

/// See [`render::settings::Algorithm`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum AlgorithmName {
    /// Passes of antialiased direct and indirect light that go on until the deadline
    Progressive,
    /// Direct and indirect light are tasks of their own (section 3.2 of the paper)
    Component,
    /// A task is all light of its pixels (section 3.1)
    Straightforward,
}

/// What makes the light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Integrator {
    /// Direct light and virtual point lights, in tasks
    Vpl,
    /// Path tracing in this process
    Path,
}

/// See [`render::reconstruct::Reconstruction`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ReconstructionName {
    /// All light averaged along surfaces, as far as its noise asks for it
    Guided,
    /// The same, less far and in half the time
    Quick,
    /// With the nearest pixel that has data, each buffer by itself
    Nearest,
    /// Not at all: missing pixels are black
    None,
}

/// See [`protocol::radiance::Encoding`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PixelsName {
    /// The same bits
    Exact,
    /// Each value within 1/2048
    Half,
    /// Each value within 1/512 of the brightest of its pixel
    SharedExponent,
}

impl From<ReconstructionName> for Reconstruction {
    fn from(name: ReconstructionName) -> Self {
        match name {
            ReconstructionName::Guided => Self::Guided,
            ReconstructionName::Quick => Self::Quick,
            ReconstructionName::Nearest => Self::Nearest,
            ReconstructionName::None => Self::None,
        }
    }
}

impl From<PixelsName> for Encoding {
    fn from(name: PixelsName) -> Self {
        match name {
            PixelsName::Exact => Self::Exact,
            PixelsName::Half => Self::Half,
            PixelsName::SharedExponent => Self::SharedExponent,
        }
    }
}

/// A value, or what the program finds out by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Auto<T> {
    /// As the flag says.
    Given(T),
    /// As measured.
    Auto,
}

/// The bound of the geometry term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Clamp {
    /// From the scene's size.
    Auto,
    /// In 1/(scene unit)².
    Bound(f32),
    /// Unbounded.
    None,
}

const DEADLINE_MIN_S: f64 = 0.1;
const DEADLINE_MAX_S: f64 = 86_400.0;

fn deadline(text: &str) -> Result<Duration, String> {
    let seconds: f64 = number(text)?;
    if !(DEADLINE_MIN_S..=DEADLINE_MAX_S).contains(&seconds) {
        return Err(format!(
            "a deadline must be from {DEADLINE_MIN_S} to {DEADLINE_MAX_S} seconds"
        ));
    }
    Ok(Duration::from_secs_f64(seconds))
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = number(text)?;
    if !(0.0..=DEADLINE_MAX_S).contains(&seconds) {
        return Err(format!("must be from 0 to {DEADLINE_MAX_S} seconds"));
    }
    Ok(Duration::from_secs_f64(seconds))
}

fn delta_t(text: &str) -> Result<Auto<Duration>, String> {
    if text == "auto" {
        return Ok(Auto::Auto);
    }
    let seconds: f64 = number(text)?;
    if !(0.0..=DEADLINE_MAX_S).contains(&seconds) {
        return Err(format!("must be `auto`, or from 0 to {DEADLINE_MAX_S} seconds"));
    }
    Ok(Auto::Given(Duration::from_secs_f64(seconds)))
}

fn image_size(text: &str) -> Result<ImageSize, String> {
    let parsed = text
        .split_once(['x', 'X', '×'])
        .and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    let Some((width, height)) = parsed else {
        return Err("a size is written as WIDTHxHEIGHT, such as 1024x768".to_owned());
    };
    let size = ImageSize { width, height };
    if !size.is_valid() {
        return Err(format!(
            "each side must be from 1 to {} pixels, and the picture at most {} pixels",
            ImageSize::SIDE_MAX,
            ImageSize::PIXELS_MAX
        ));
    }
    Ok(size)
}

fn clamp(text: &str) -> Result<Clamp, String> {
    match text {
        "auto" => Ok(Clamp::Auto),
        "none" => Ok(Clamp::None),
        _ => match number::<f32>(text)? {
            bound if bound.is_finite() && bound > 0.0 => Ok(Clamp::Bound(bound)),
            _ => Err("must be `auto`, `none`, or a positive number".to_owned()),
        },
    }
}

fn slots(text: &str) -> Result<Auto<u32>, String> {
    let max = protocol::limits::SLOTS;
    if text == "auto" {
        return Ok(Auto::Auto);
    }
    match text.parse() {
        Ok(slots) if slots <= max => Ok(Auto::Given(slots)),
        _ => Err(format!("must be `auto`, or a whole number from 0 to {max}")),
    }
}

fn percent(text: &str) -> Result<f32, String> {
    match number::<f32>(text)? {
        percent if (0.0..=100.0).contains(&percent) => Ok(percent),
        _ => Err("must be from 0 to 100 percent".to_owned()),
    }
}

fn finite(text: &str) -> Result<f32, String> {
    match number::<f32>(text)? {
        value if value.is_finite() => Ok(value),
        _ => Err("must be a finite number".to_owned()),
    }
}

fn listen(text: &str) -> Result<SocketAddr, String> {
    let mut addresses = text
        .to_socket_addrs()
        .map_err(|error| format!("an address is written as HOST:PORT, such as 0.0.0.0:7420 ({error})"))?;
    addresses
        .next()
        .ok_or_else(|| "this name has no address".to_owned())
}

fn number<T: std::str::FromStr>(text: &str) -> Result<T, String> {
    text.parse().ok().ok_or_else(|| "not a number".to_owned())
}

impl Auto<u32> {
    /// The number of slots: as given, or one for each core.
    pub fn or_one_per_core(self) -> u32 {
        match self {
            Self::Given(slots) => slots,
            Self::Auto => std::thread::available_parallelism()
                .map_or(1, NonZeroUsize::get)
                .min(protocol::limits::SLOTS as usize) as u32,
        }
    }
}
