//! Fills the report from what the program knows.

use render::{
    reconstruct::{Coverage, Reconstruction},
    settings::{Algorithm, LightPoints, Settings},
};

use crate::{
    cli::{Integrator, VERSION},
    deadline::Ledger,
    frame::Frame,
    frame_time::FrameTime,
    job::Job,
    progress::component_name,
    report::{LedgerReport, ReconstructedPercent, Report, SamplesPerPixel, SettingsReport, TaskCounts},
    session::Prepared,
};

/// All that is known when the tracing is over.
pub fn of_frame(job: &Job, frame: &Frame, prepared: &Prepared) -> Report {
    let rays = frame.rays();
    let (busy, tracing) = frame.times();
    let mut report = of_job(job, prepared);
    report.shadow_rays = rays.shadow;
    report.primary_rays = rays.primary;
    report.busy_slot_seconds = busy.as_secs_f64();
    report.seconds.tracing = tracing.as_secs_f64();
    report.slots = frame.roster().slots_most();
    report.workers = frame.roster().reports().to_vec();
    if let Some(scheduler) = frame.scheduler() {
        report.late_results = scheduler.late_results();
        let counts = scheduler.tallies().iter().map(|(&component, tally)| {
            let counts = TaskCounts {
                total: tally.total,
                completed: tally.completed,
                partial: tally.partial,
            };
            (component_name(component), counts)
        });
        report.tasks = counts.collect();
    }
    report
}

/// All that is known before the first ray.
pub fn of_job(job: &Job, prepared: &Prepared) -> Report {
    let mut report = Report {
        deadline_s: job.deadline.map(|deadline| deadline.elapsed().as_secs_f64()),
        version: VERSION.to_owned(),
        settings: settings(job, prepared),
        files: [&job.files.exr, &job.files.png]
            .into_iter()
            .flatten()
            .map(|path| path.display().to_string())
            .collect(),
        ..Report::default()
    };
    report.seconds.load = prepared.load.as_secs_f64();
    report.seconds.bvh = prepared.bvh.as_secs_f64();
    report.seed = prepared.settings.map_or(0, |settings| settings.seed);
    report
}

/// How the end of the tracing was chosen.
pub fn of_ledger(ledger: &Ledger, now: FrameTime) -> LedgerReport {
    LedgerReport {
        cut_off_s: now.elapsed().as_secs_f64(),
        finish_predicted_s: ledger.finish_time().as_secs_f64(),
        margin_s: ledger.margin().as_secs_f64(),
        cpu_share: ledger.share(),
    }
}

/// How much was real data.
pub fn add_coverage(report: &mut Report, coverage: &Coverage) {
    report.reconstructed_percent = ReconstructedPercent {
        direct: coverage.direct_reconstructed_percent,
        indirect: coverage.indirect_reconstructed_percent,
    };
    report.open_sets = coverage.open_sets;
    report.dropped_sets = coverage.dropped_sets;
    report.samples_per_pixel = SamplesPerPixel {
        direct: coverage.direct_samples,
        indirect: coverage.indirect_samples,
    };
}

/// When the picture was in its place.
pub fn add_time(report: &mut Report, now: FrameTime) {
    report.elapsed_s = now.elapsed().as_secs_f64();
    report.slack_s = report.deadline_s.map(|deadline| deadline - report.elapsed_s);
}

/// The workload in a few words.
pub fn workload(settings: &Settings) -> String {
    let Settings {
        groups,
        spp,
        vpls,
        vpl_sets,
        ..
    } = settings;
    let size = format!("{}x{}", settings.size.width, settings.size.height);
    let clamp = match settings.geometry_clamp {
        Some(bound) => format!("geometry term up to {bound:.3e}"),
        None => "geometry term unbounded".to_owned(),
    };
    let passes = match (settings.algorithm, *spp) {
        (Algorithm::Progressive, Settings::SPP_MAX) => "passes without end".to_owned(),
        _ => format!("{spp} passes"),
    };
    format!("{size}, {groups} groups, {passes}, {vpls} VPLs in {vpl_sets} sets, {clamp}")
}

/// As on the command line.
pub fn reconstruction_name(reconstruction: Reconstruction) -> &'static str {
    match reconstruction {
        Reconstruction::Guided => "guided",
        Reconstruction::Quick => "quick",
        Reconstruction::Nearest => "nearest",
        Reconstruction::None => "none",
    }
}

fn settings(job: &Job, prepared: &Prepared) -> SettingsReport {
    let mut report = SettingsReport {
        scene: job.scene.display().to_string(),
        scene_digest: prepared.digest.clone(),
        integrator: match job.integrator {
            Integrator::Vpl => "vpl",
            Integrator::Path => "path",
        },
        paper: job.paper,
        paper_overridden_by: job.overrides.clone(),
        reconstruction: reconstruction_name(job.reconstruction),
        reconstruction_used: reconstruction_name(job.reconstruction),
        min_set_percent: job.min_set_percent,
        exposure_stops: job.exposure_stops,
        ..SettingsReport::default()
    };
    if let Some(settings) = prepared.settings {
        report.algorithm = match settings.algorithm {
            Algorithm::Progressive => "progressive",
            Algorithm::Component => "component",
            Algorithm::Straightforward => "straightforward",
        };
        report.light_points = match settings.light_points {
            LightPoints::PerPass => "per_pass",
            LightPoints::PerPixel => "per_pixel",
        };
        (report.width, report.height) = (settings.size.width, settings.size.height);
        (report.groups, report.spp) = (settings.groups, settings.spp);
        (report.vpls, report.vpl_sets) = (settings.vpls, settings.vpl_sets);
        report.geometry_clamp = settings.geometry_clamp;
    }
    report
}
