//! The command line of `eval`.
//!
//! Exit codes: 0 when everything was done; 2 for wrong flags, files that cannot be read or compared,
//! and results that cannot be written. Then stdout is empty and stderr says why.

use std::io::{ErrorKind, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::str::FromStr;

use anyhow::Context;
use clap::{Args, Parser, Subcommand};

use crate::compare::{self, Options};
use crate::export::{self, ExportArgs};
use crate::grid::command::{self as grid, GridArgs};
use crate::metrics::{flip, vdp};
use crate::paper::command::{self as paper, PaperArgs};
use crate::paper::realtime::{self, RealtimeArgs};

/// Judges pictures and schedulers.
#[derive(Debug, Parser)]
#[command(name = "eval", version)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Says how unlike a reference pictures are: VDP, FLIP, RMSE, relMSE, SSIM, PSNR
    #[command(after_long_help = "docs/metrics.md says what the numbers mean.")]
    Compare(CompareArgs),
    /// Renders a frame on a grid that exists only as numbers: real scheduler, real tasks, simulated time
    Grid(GridArgs),
    /// Reproduces the paper's tables and figures as one page, with what holds and what does not
    Paper(PaperArgs),
    /// Compares the paper's two algorithms by the clock, on this machine
    Realtime(RealtimeArgs),
    /// Writes a scene as PLY, PNG and JSON, for other renderers to show the same
    Export(ExportArgs),
}

#[derive(Debug, Args)]
struct CompareArgs {
    /// The reference: EXR or PFM (linear light), or PNG (sRGB codes)
    gold: PathBuf,
    /// Pictures of the same size to judge by it
    #[arg(required = true)]
    images: Vec<PathBuf>,
    /// One JSON object on stdout instead of a table
    #[arg(long)]
    json: bool,
    /// Writes maps as PNG into this folder: NAME.vdp.png, NAME.flip.png, NAME.error.png, NAME.ssim.png
    #[arg(long, value_name = "DIR")]
    maps: Option<PathBuf>,
    /// Multiplies linear light by two to this power for VDP, SSIM and PSNR
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, value_parser = finite, allow_negative_numbers = true)]
    exposure: f64,
    /// The layer of EXR files to compare, such as `direct` [default: the picture itself]
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
    /// Counts NaN as 0 and infinity as 65504 instead of refusing the file
    #[arg(long)]
    allow_nan: bool,
    #[command(flatten)]
    vdp: VdpArgs,
    /// Pixels per degree for FLIP
    #[arg(long, value_name = "N", default_value_t = flip::PIXELS_PER_DEGREE, value_parser = pixels_per_degree)]
    flip_ppd: f64,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Viewing conditions and masking of the VDP")]
struct VdpArgs {
    /// Luminance of white, cd/m²
    #[arg(long = "vdp-peak", value_name = "CD_M2", default_value_t = vdp::Viewing::default().peak)]
    peak: f64,
    /// Luminance of black with flare, cd/m²
    #[arg(long = "vdp-black", value_name = "CD_M2", default_value_t = vdp::Viewing::default().black)]
    black: f64,
    /// From eye to screen, metres
    #[arg(long = "vdp-distance", value_name = "METRES", default_value_t = vdp::Viewing::default().distance)]
    distance: f64,
    /// Pixels per degree [default: those of 1280 pixels on 0.375 m at the distance]
    #[arg(long = "vdp-ppd", value_name = "N")]
    ppd: Option<f64>,
    /// Slope of masking: one for all bands, six (finest band first, base last), or `all` for every
    /// published setting side by side
    #[arg(long = "vdp-slopes", value_name = "S|S,S,S,S,S,S|all", default_value = "1.0")]
    slopes: SlopesChoice,
    /// Does not blur the thresholds
    #[arg(long = "vdp-no-phase-uncertainty")]
    no_phase_uncertainty: bool,
    /// Counts pixels of equal luminance as invisible, also in the map
    #[arg(long = "vdp-zero-identical")]
    zero_identical: bool,
}

/// One setting of the slopes, or all that were published.
#[derive(Debug, Clone, PartialEq)]
struct SlopesChoice(Vec<vdp::Slopes>);

impl FromStr for SlopesChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "all" {
            return Ok(Self(vdp::Slopes::PUBLISHED.to_vec()));
        }
        let number = |word: &str| word.trim().parse().map_err(|error| format!("{word:?}: {error}"));
        let numbers: Vec<f64> = text.split(',').map(number).collect::<Result<_, _>>()?;
        let slopes = match numbers[..] {
            [slope] => [slope; 6],
            _ => numbers.try_into().map_err(|numbers: Vec<f64>| {
                format!("{} numbers; give one, or six with commas, or all", numbers.len())
            })?,
        };
        Ok(Self(vec![vdp::Slopes(slopes)]))
    }
}

fn finite(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err("need a finite number".into()),
    }
}

/// Bounded above by a kernel of a few thousand pixels, for memory's and time's sake.
fn pixels_per_degree(text: &str) -> Result<f64, String> {
    match finite(text)? {
        number if (1.0..=1e4).contains(&number) => Ok(number),
        _ => Err("need a number from 1 to 10000".into()),
    }
}

/// Reads the command line; wrong flags end the program with exit code 2.
#[must_use]
pub fn parse() -> Cli {
    Cli::parse()
}

/// Does what the command line says; results go to stdout, once all of them are there.
pub fn run(cli: Cli) -> anyhow::Result<()> {
    match cli.command {
        Command::Compare(args) => {
            let json = args.json;
            let report = compare::run(&args.into())?;
            print(&if json {
                report.to_json()?
            } else {
                report.to_table()
            })
        }
        Command::Grid(args) => print(&grid::run(&args)?),
        Command::Paper(args) => print(&paper::run(&args)?),
        Command::Realtime(args) => print(&realtime::run(&args)?),
        Command::Export(args) => print(&export::run(&args)?),
    }
}

/// Tells an error on stderr, and the exit code that belongs to it.
pub fn exit_code(outcome: anyhow::Result<()>) -> ExitCode {
    let Err(error) = outcome else {
        return ExitCode::SUCCESS;
    };
    // Where stderr is closed there is nobody to tell.
    let _ = writeln!(std::io::stderr(), "error: {error:#}");
    ExitCode::from(2)
}

fn print(text: &str) -> anyhow::Result<()> {
    match writeln!(std::io::stdout(), "{text}") {
        // A reader such as `head` may have seen enough.
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        outcome => outcome.context("cannot write to stdout"),
    }
}

impl From<CompareArgs> for Options {
    fn from(args: CompareArgs) -> Self {
        let viewing = vdp::Viewing {
            peak: args.vdp.peak,
            black: args.vdp.black,
            distance: args.vdp.distance,
            pixels_per_degree: args.vdp.ppd,
        };
        Self {
            gold: args.gold,
            images: args.images,
            layer: args.layer,
            allow_nan: args.allow_nan,
            exposure_stops: args.exposure,
            maps: args.maps,
            vdp: vdp::Settings {
                viewing,
                phase_uncertainty: !args.vdp.no_phase_uncertainty,
                zero_identical: args.vdp.zero_identical,
            },
            slopes: args.vdp.slopes.0,
            flip_pixels_per_degree: args.flip_ppd,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn slopes_are_one_number_six_numbers_or_all() {
        let parse = |text: &str| text.parse::<SlopesChoice>();
        assert_eq!(parse("0.9"), Ok(SlopesChoice(vec![vdp::Slopes::NINE_TENTHS])));
        assert_eq!(
            parse("1,1,1,0.8,0.8,0.7"),
            Ok(SlopesChoice(vec![vdp::Slopes::PER_BAND]))
        );
        assert_eq!(parse("all"), Ok(SlopesChoice(vdp::Slopes::PUBLISHED.to_vec())));
        assert_eq!(
            parse("1,1"),
            Err("2 numbers; give one, or six with commas, or all".into())
        );
        assert_eq!(parse("steep"), Err("\"steep\": invalid float literal".into()));
    }
}
