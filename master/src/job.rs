//! What is asked for: the command line, checked and made complete.

use std::{net::SocketAddr, path::PathBuf, time::Duration};

use protocol::{Keys, radiance::Encoding};
use render::{
    reconstruct::Reconstruction,
    scene::{ImageSize, Scene},
    settings::{Algorithm, LightPoints, Settings},
};

use crate::{
    admission,
    cli::{AlgorithmName, Auto, Clamp, Integrator, RenderArgs},
    deliver::{DeliverError, PictureFiles},
    exit::{Exit, Failure, OrExit},
    frame_time::FrameTime,
    scene_path, wire,
};

/// Picture size of the paper.
const PAPER_SIZE: ImageSize = ImageSize {
    width: 1024,
    height: 768,
};
/// Paths for each pixel of the reference.
const PATHS_DEFAULT: u32 = 256;
/// Shortest deadline for guided reconstruction, for each pixel: it takes 0.2 to 0.5 µs on two cores.
const GUIDED_TIME_MIN: Duration = Duration::from_nanos(2_500);
/// The same for the quick one.
const QUICK_TIME_MIN: Duration = Duration::from_nanos(1_500);
/// A VPL nearer than this share of the scene's extent counts as if it were this far away.
const CLAMP_DISTANCE_SHARE: f32 = 0.05;
/// VPLs in a set of the progressive algorithm.
const VPLS_PER_SET: u32 = 16;
/// VPL sets of the progressive algorithm for each second of the deadline: a pixel meets a few dozens of
/// them in this time, and 16 groups meet different ones.
const SETS_PER_SECOND: f64 = 512.0;
/// Fewest VPL sets of the progressive algorithm.
const SETS_MIN: u32 = 256;

/// See [`RenderArgs::min_set_percent`].
const MIN_SET_PERCENT_DEFAULT: f32 = 25.0;

/// A picture to be made.
#[derive(Debug, Clone)]
pub struct Job {
    /// `None`: the full workload, however long it takes.
    pub deadline: Option<FrameTime>,
    /// The scene file.
    pub scene: PathBuf,
    /// What `$GRIDLIGHT_SCENES` stands for.
    pub scenes_dir: PathBuf,
    /// Where the picture goes.
    pub files: PictureFiles,
    /// Where the report goes.
    pub report: Option<PathBuf>,
    /// What makes the light.
    pub integrator: Integrator,
    /// Whether this is the paper's renderer.
    pub paper: bool,
    /// Flags that override a value of the paper.
    pub overrides: Vec<&'static str>,
    /// How missing pixels are filled in.
    pub reconstruction: Reconstruction,
    /// Share of pixels under which a set is left out.
    pub min_set_percent: f32,
    /// Brightness of the PNG.
    pub exposure_stops: f32,
    /// The paper's Δt, if it is not to be measured.
    pub delta_t: Option<Duration>,
    /// Where workers connect.
    pub listen: SocketAddr,
    /// What a worker must have to join; `None`: nothing.
    pub keys: Option<Keys>,
    /// Slots of the worker that this process starts.
    pub local_slots: u32,
    /// How results come back, if all in one way.
    pixels: Option<Encoding>,
    workload: Workload,
}

/// The flags that make up the settings, as given.
#[derive(Debug, Clone, Copy)]
struct Workload {
    algorithm: Algorithm,
    size: Option<ImageSize>,
    groups: Option<u32>,
    spp: Option<u32>,
    vpls: Option<u32>,
    vpl_sets: Option<u32>,
    deadline: Option<Duration>,
    seed: u64,
    clamp: Clamp,
    light_points: LightPoints,
}

impl Job {
    /// Checks all that can be checked without reading the scene.
    pub fn new(args: &RenderArgs) -> Result<Self, Failure> {
        let workload = Workload::new(args);
        check(&workload.settings(workload.size.unwrap_or(PAPER_SIZE), None)).or_exit(Exit::Usage)?;
        let files = PictureFiles::new(&args.out, args.no_png).map_err(|error| {
            let exit = match error {
                DeliverError::Extension(_) => Exit::Usage,
                _ => Exit::Output,
            };
            Failure::new(exit, anyhow::Error::new(error).context("--out"))
        })?;
        Ok(Self {
            deadline: (!args.no_deadline).then(|| FrameTime::after_start(args.deadline)),
            scene: args.scene.clone().unwrap_or_else(scene_path::default_scene),
            scenes_dir: scene_path::scenes_dir(),
            files,
            report: args.report.clone(),
            integrator: args.integrator.unwrap_or(Integrator::Vpl),
            paper: args.paper,
            overrides: if args.paper { overrides(args) } else { Vec::new() },
            reconstruction: args
                .reconstruction
                .map_or_else(|| workload.reconstruction(), Reconstruction::from),
            min_set_percent: args.min_set_percent.unwrap_or(MIN_SET_PERCENT_DEFAULT),
            exposure_stops: args.exposure,
            delta_t: match args.delta_t {
                Auto::Given(delta_t) => Some(delta_t),
                Auto::Auto => None,
            },
            listen: args.listen,
            keys: admission::keys(&args.key, args.listen)?,
            local_slots: args.local_slots.or_one_per_core(),
            pixels: args.pixels.map(Encoding::from),
            workload,
        })
    }

    /// How a worker writes its results. Without a deadline there is time for every bit, and on one machine
    /// the bits cost nothing.
    pub fn encoding(&self, is_local: bool) -> Encoding {
        let unasked = if is_local || self.deadline.is_none() {
            Encoding::Exact
        } else {
            Encoding::SharedExponent
        };
        self.pixels.unwrap_or(unasked)
    }

    /// The settings for a scene.
    pub fn settings(&self, scene: &Scene) -> anyhow::Result<Settings> {
        let size = self.workload.size.unwrap_or(scene.image);
        let settings = self.workload.settings(size, Some(scene.extent()));
        check(&settings)?;
        Ok(settings)
    }

    /// The settings as far as they are known before the scene is, for a picture of another size.
    pub fn settings_at(&self, size: ImageSize) -> Settings {
        self.workload.settings(size, None)
    }

    /// Whether the picture shows pixels as a whole instead of their centres.
    pub fn is_antialiased(&self) -> bool {
        self.workload.algorithm == Algorithm::Progressive
    }

    /// Paths for each pixel of the reference.
    pub fn paths(&self) -> u32 {
        self.workload.spp.unwrap_or(PATHS_DEFAULT)
    }

    /// The picture's size as far as it is known before the scene is.
    pub fn size_expected(&self) -> ImageSize {
        self.workload.size.unwrap_or(PAPER_SIZE)
    }
}

/// Checks our own limits and those of the wire, on which a worker would close the connection.
fn check(settings: &Settings) -> anyhow::Result<()> {
    settings.validate()?;
    Ok(wire::settings_to_wire(settings).check()?)
}

impl Workload {
    fn new(args: &RenderArgs) -> Self {
        Self {
            algorithm: match args.algorithm {
                None if args.paper => Algorithm::Component,
                None | Some(AlgorithmName::Progressive) => Algorithm::Progressive,
                Some(AlgorithmName::Component) => Algorithm::Component,
                Some(AlgorithmName::Straightforward) => Algorithm::Straightforward,
            },
            size: args.size.or(args.paper.then_some(PAPER_SIZE)),
            groups: args.groups,
            spp: args.spp,
            vpls: args.vpls,
            vpl_sets: args.vpl_sets,
            deadline: (!args.no_deadline).then_some(args.deadline),
            seed: args.seed.unwrap_or(0),
            clamp: args.clamp.unwrap_or(Clamp::Auto),
            light_points: if args.paper {
                LightPoints::PerPass
            } else {
                LightPoints::PerPixel
            },
        }
    }

    /// `extent`: size of the scene in scene units, once it is known.
    fn settings(&self, size: ImageSize, extent: Option<f32>) -> Settings {
        let base = match self.algorithm {
            Algorithm::Progressive => self.progressive(size),
            algorithm => Settings::paper(algorithm, size),
        };
        Settings {
            groups: self.groups.unwrap_or(base.groups),
            spp: self.spp.unwrap_or(base.spp),
            vpls: self.vpls.unwrap_or(base.vpls),
            vpl_sets: self.vpl_sets.unwrap_or(base.vpl_sets),
            seed: self.seed,
            geometry_clamp: match (self.clamp, extent) {
                (Clamp::Bound(bound), _) => Some(bound),
                (Clamp::Auto, Some(extent)) => Some((CLAMP_DISTANCE_SHARE * extent).powi(-2)),
                (Clamp::None, _) | (Clamp::Auto, None) => None,
            },
            light_points: self.light_points,
            ..base
        }
    }

    /// The best that does not take the time from the light that it is made of.
    fn reconstruction(&self) -> Reconstruction {
        let pixels = self.size.unwrap_or(PAPER_SIZE).pixel_count() as u32;
        let time_each = self.deadline.map_or(Duration::MAX, |deadline| deadline / pixels);
        match self.algorithm {
            Algorithm::Progressive if time_each >= GUIDED_TIME_MIN => Reconstruction::Guided,
            Algorithm::Progressive if time_each >= QUICK_TIME_MIN => Reconstruction::Quick,
            _ => Reconstruction::Nearest,
        }
    }

    /// Without end while there is a deadline, and with as many VPLs as may be met.
    fn progressive(&self, size: ImageSize) -> Settings {
        let base = Settings::progressive(size);
        let sets_min = if self.vpls.is_some() { 1 } else { SETS_MIN };
        let sets = match (self.vpl_sets, self.vpls, self.deadline) {
            (Some(sets), ..) => sets,
            (None, Some(vpls), _) => vpls / VPLS_PER_SET,
            (None, None, Some(deadline)) => {
                ((SETS_PER_SECOND * deadline.as_secs_f64()) as u32).next_power_of_two()
            }
            (None, None, None) => {
                let spp = self.spp.unwrap_or(base.spp);
                base.groups
                    .saturating_mul(spp)
                    .checked_next_power_of_two()
                    .unwrap_or(u32::MAX)
            }
        };
        let vpl_sets = sets.clamp(sets_min, Settings::VPL_SETS_MAX);
        Settings {
            spp: match self.deadline {
                Some(_) => Settings::SPP_MAX,
                None => base.spp,
            },
            vpls: VPLS_PER_SET * self.vpl_sets.unwrap_or(vpl_sets).clamp(1, Settings::VPL_SETS_MAX),
            vpl_sets,
            ..base
        }
    }
}

/// The given flags of which the paper says something else.
fn overrides(args: &RenderArgs) -> Vec<&'static str> {
    let given = [
        ("--size", args.size.is_some()),
        ("--groups", args.groups.is_some()),
        ("--spp", args.spp.is_some()),
        ("--vpls", args.vpls.is_some()),
        ("--vpl-sets", args.vpl_sets.is_some()),
        ("--clamp", args.clamp.is_some()),
        ("--reconstruction", args.reconstruction.is_some()),
        ("--min-set-percent", args.min_set_percent.is_some()),
    ];
    given
        .into_iter()
        .filter_map(|(flag, given)| given.then_some(flag))
        .collect()
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use protocol::key_file;

    use super::*;
    use crate::cli::Cli;

    fn job(flags: &str) -> Result<Job, Failure> {
        let cli = Cli::try_parse_from(format!("master {flags}").split_whitespace()).unwrap();
        Job::new(&cli.render)
    }

    fn settings(flags: &str) -> Settings {
        let job = job(flags).unwrap();
        job.workload.settings(job.size_expected(), Some(100.0))
    }

    #[test]
    fn paper_has_the_papers_parameters() {
        for algorithm in [Algorithm::Component, Algorithm::Straightforward] {
            let flag = format!("--paper --algorithm {algorithm:?}").to_lowercase();
            let expected = Settings {
                geometry_clamp: Some(1.0 / 25.0),
                ..Settings::paper(algorithm, PAPER_SIZE)
            };
            assert_eq!(settings(&flag), expected);
        }
        assert_eq!(job("--paper").unwrap().overrides, [""; 0]);
    }

    #[test]
    fn passes_and_vpls_are_as_many_as_the_time_may_need() {
        let workload = |flags: &str| {
            let settings = settings(flags);
            (settings.spp, settings.vpls, settings.vpl_sets)
        };
        assert_eq!(workload("--deadline 2"), (Settings::SPP_MAX, 16 * 1024, 1024));
        assert_eq!(workload("--deadline 0.2"), (Settings::SPP_MAX, 16 * 256, 256));
        assert_eq!(workload("--deadline 9999"), (Settings::SPP_MAX, 16 * 4096, 4096));
        assert_eq!(workload("--no-deadline --spp 32"), (32, 16 * 512, 512));
        assert_eq!(workload("--deadline 2 --vpls 64"), (Settings::SPP_MAX, 64, 4));
        assert_eq!(workload("--deadline 2 --vpl-sets 3"), (Settings::SPP_MAX, 48, 3));
    }

    #[test]
    fn short_deadlines_leave_the_time_to_the_light() {
        use Reconstruction::{Guided, Nearest, Quick};
        for (flags, expected) in [
            ("--deadline 2", Guided),
            ("--deadline 1.5", Quick),
            ("--deadline 1", Nearest),
            ("--deadline 0.5 --size 512x384", Guided),
            ("--deadline 0.5 --reconstruction guided", Guided),
            ("--no-deadline", Guided),
            ("--paper --deadline 8", Nearest),
        ] {
            assert_eq!(job(flags).unwrap().reconstruction, expected, "{flags}");
        }
    }

    #[test]
    fn flags_override_single_values_of_the_paper_and_are_named() {
        let flags = "--paper --vpls 64 --spp 4 --seed 7";
        assert_eq!(job(flags).unwrap().overrides, ["--spp", "--vpls"]);
        let settings = settings(flags);
        assert_eq!(
            (settings.vpls, settings.spp, settings.groups, settings.seed),
            (64, 4, 64, 7)
        );
    }

    #[test]
    fn results_are_packed_when_they_come_from_elsewhere_and_there_is_a_deadline() {
        let encodings = |flags: &str| [true, false].map(|is_local| job(flags).unwrap().encoding(is_local));
        assert_eq!(encodings(""), [Encoding::Exact, Encoding::SharedExponent]);
        assert_eq!(encodings("--no-deadline"), [Encoding::Exact; 2]);
        assert_eq!(encodings("--pixels half"), [Encoding::Half; 2]);
        assert_eq!(encodings("--pixels exact"), [Encoding::Exact; 2]);
    }

    #[test]
    fn an_address_that_others_can_reach_needs_a_key_or_a_word() {
        for address in ["0.0.0.0:7420", "[::]:7420", "192.0.2.1:0"] {
            let failure = job(&format!("--listen {address}")).unwrap_err();
            assert_eq!(failure.exit, Exit::Usage);
            for part in ["--key", "keygen", "--insecure"] {
                assert!(failure.error.to_string().contains(part), "{part}");
            }
            assert!(
                job(&format!("--listen {address} --insecure"))
                    .unwrap()
                    .keys
                    .is_none()
            );
        }
        for address in ["127.0.0.1:0", "127.0.0.2:7420", "[::1]:0"] {
            assert!(job(&format!("--listen {address}")).is_ok(), "{address}");
        }
    }

    #[test]
    fn a_key_file_is_read_before_anything_starts() {
        assert_eq!(job("--key nowhere/grid.key").unwrap_err().exit, Exit::Key);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grid.key");
        let key = key_file::create(&path).unwrap();
        let flags = format!("--listen 0.0.0.0:0 --key {}", path.display());
        let keys = job(&flags).unwrap().keys.unwrap();
        assert_eq!(keys.fingerprints(), key.fingerprint());
        assert_eq!(job(&format!("{flags} --insecure")).unwrap_err().exit, Exit::Usage);
    }

    #[test]
    fn impossible_workloads_are_refused_before_anything_starts() {
        for flags in [
            "--spp 0",
            "--vpls 0",
            "--groups 0",
            "--vpl-sets 0",
            "--vpls 256 --vpl-sets 15",
            "--groups 1 --size 2048x2048",
        ] {
            let failure = job(flags).unwrap_err();
            assert_eq!(failure.exit, Exit::Usage, "{flags}");
        }
    }
}
