//! Makes a frame ready on a thread of its own: scene, BVH, VPLs, and what the eye sees first.

use std::{path::Path, sync::Arc, thread, time::Duration};

use render::{
    gbuffer::{Aovs, antialias_aovs, trace_aovs},
    intersect::TracedScene,
    pixel_group::PixelGroups,
    scene::load::{LoadOptions, LoadedScene, load},
    settings::Settings,
    vpl::{VplSet, trace_sets, trace_sets_thoroughly},
};
use tokio::sync::mpsc;

use crate::{
    cli::Integrator,
    clock::Clock,
    cores,
    exit::{Exit, Failure, OrExit},
    job::Job,
    scene_bytes::SceneBytes,
};

/// Fewest rays through a pixel on an edge.
const AOV_SAMPLES_MIN: u32 = 4;
/// Most rays through a pixel on an edge, and the deadline that gives time for them.
const AOV_SAMPLES_MAX: u32 = 16;
const AOV_SAMPLES_MAX_FROM: Duration = Duration::from_secs(8);

/// What has become ready. Comes in this order.
#[derive(Debug)]
pub enum Ready {
    /// The scene is in memory.
    Loaded(Loaded),
    /// Tasks can be handed out.
    Traceable(Traceable),
    /// The picture can be assembled; comes again, antialiased, if there is time for that.
    Aovs(Arc<Aovs>),
}

impl Ready {
    fn name(&self) -> &'static str {
        match self {
            Self::Loaded(_) => "the scene is in memory",
            Self::Traceable(_) => "tasks can be handed out",
            Self::Aovs(_) => "the first surfaces are known",
        }
    }
}

/// A scene in memory.
#[derive(Debug)]
pub struct Loaded {
    /// Digest of its files, as text.
    pub digest: String,
    /// Number of triangles.
    pub triangles: usize,
    /// What people should know.
    pub notes: Vec<String>,
    /// The workload.
    pub settings: Settings,
    /// Time to read the files.
    pub load: Duration,
    /// What workers need of it.
    pub geometry: SceneBytes,
}

/// A scene in which rays can be traced.
#[derive(Debug)]
pub struct Traceable {
    /// The scene and its BVH.
    pub scene: Arc<TracedScene>,
    /// Which pixels each group has.
    pub groups: Arc<PixelGroups>,
    /// The VPLs, traced once for all workers: other processors would find other hits, and one VPL that
    /// differs is a seam over the whole image.
    pub vpl_sets: Vec<VplSet>,
    /// Time to build the BVH.
    pub bvh: Duration,
}

/// Starts the thread. The channel ends after the last step, or with the failure.
pub fn start(job: &Job, clock: Clock) -> mpsc::UnboundedReceiver<Result<Ready, Failure>> {
    let (sender, receiver) = mpsc::unbounded_channel();
    let job = job.clone();
    thread::spawn(move || {
        // If nobody listens any more the program is ending.
        let tell = |ready: Result<Ready, Failure>| drop(sender.send(ready));
        let told = |ready: Ready| {
            tracing::debug!(at = %clock.now(), "{}", ready.name());
            tell(Ok(ready));
        };
        // Without a scene and what the eye sees first there is no picture at all.
        let is_urgent = job.deadline.is_some();
        if is_urgent {
            // The process has ended when this thread has, too.
            cores::go_first();
        }
        let threads = cores::unbound(is_urgent).or_exit(Exit::Unforeseen);
        let prepared = threads.and_then(|threads| threads.install(|| prepare(&job, clock, told)));
        if let Err(failure) = prepared {
            tell(Err(failure));
        }
    });
    receiver
}

fn prepare(job: &Job, clock: Clock, tell: impl Fn(Ready) + Sync) -> Result<(), Failure> {
    let options = LoadOptions {
        scenes_dir: job.scenes_dir.clone(),
    };
    let (loaded, load) = clock.time(|| load_scene(&job.scene, &options));
    let loaded = loaded?;
    let settings = job.settings(&loaded.scene).or_exit(Exit::Usage)?;
    tell(Ready::Loaded(Loaded {
        digest: hex(&loaded.digest),
        triangles: loaded.scene.mesh.triangles.len(),
        notes: loaded.notes.iter().map(ToString::to_string).collect(),
        settings,
        load,
        geometry: SceneBytes::new(&loaded.scene),
    }));

    let ((scene, bvh), groups) = rayon::join(
        || clock.time(|| TracedScene::build(loaded.scene)),
        || Arc::new(PixelGroups::new(&settings)),
    );
    let scene = Arc::new(scene.or_exit(Exit::Scene)?);
    let vpl_sets = match job.integrator {
        Integrator::Vpl if job.deadline.is_none() => trace_sets_thoroughly(&scene, &settings),
        Integrator::Vpl => trace_sets(&scene, &settings),
        Integrator::Path => Vec::new(),
    };
    tell(Ready::Traceable(Traceable {
        scene: Arc::clone(&scene),
        groups,
        vpl_sets,
        bvh,
    }));
    let aovs = Arc::new(trace_aovs(&scene, settings.size));
    tell(Ready::Aovs(Arc::clone(&aovs)));
    if job.is_antialiased() {
        // Tasks have begun, so this is no longer urgent.
        let threads = cores::unbound(false).or_exit(Exit::Unforeseen)?;
        let half_time = job.deadline.map(|deadline| deadline.elapsed() / 2);
        let stop = || half_time.is_some_and(|half_time| clock.now().elapsed() > half_time);
        let smooth = threads.install(|| antialias_aovs(&scene, &aovs, aov_samples(job), &stop));
        if let Some(smooth) = smooth {
            tell(Ready::Aovs(Arc::new(smooth)));
        }
    }
    Ok(())
}

/// Rays through each pixel on an edge: as many as take about a hundredth of the time.
fn aov_samples(job: &Job) -> u32 {
    let per_second = f64::from(AOV_SAMPLES_MAX) / AOV_SAMPLES_MAX_FROM.as_secs_f64();
    job.deadline.map_or(AOV_SAMPLES_MAX, |deadline| {
        ((per_second * deadline.elapsed().as_secs_f64()) as u32).clamp(AOV_SAMPLES_MIN, AOV_SAMPLES_MAX)
    })
}

fn load_scene(path: &Path, options: &LoadOptions) -> Result<LoadedScene, Failure> {
    load(path, options).or_exit(Exit::Scene)
}

fn hex(digest: &[u8]) -> String {
    digest
        .iter()
        .fold(String::new(), |text, byte| text + &format!("{byte:02x}"))
}
