//! `--integrator path`: the reference picture, by path tracing in this process.

use std::thread;

use anyhow::anyhow;
use render::path::{Through, path_trace};
use tokio::sync::mpsc;

use crate::{
    deliver::StagedPicture,
    exit::{Exit, Failure, OrExit},
    finish,
    prepare::{self, Ready, Traceable},
    progress::Progress,
    reporting,
    run::Delivered,
    session::{Prepared, Setting},
};

/// Traces all paths, then delivers. A signal ends the process without a picture: half of the rows are
/// no reference.
pub async fn run(
    setting: Setting,
    mut staged: StagedPicture,
    progress: &mut Progress,
) -> Result<Delivered, Failure> {
    let clock = setting.clock;
    let mut prepared = Prepared::default();
    let mut ready = prepare::start(&setting.job, clock);
    let mut traceable: Option<Traceable> = None;
    let mut aovs = None;
    while let Some(step) = ready.recv().await {
        match step? {
            Ready::Loaded(loaded) => {
                for note in &loaded.notes {
                    tracing::warn!("{note}");
                }
                prepared.settings = Some(loaded.settings);
                prepared.digest = loaded.digest;
                prepared.load = loaded.load;
            }
            Ready::Traceable(ready) => {
                prepared.bvh = ready.bvh;
                traceable = Some(ready);
            }
            Ready::Aovs(ready) => aovs = Some(ready),
        }
    }
    let (Some(settings), Some(traceable), Some(aovs)) = (prepared.settings, traceable, aovs) else {
        return Err(Failure::new(
            Exit::Unforeseen,
            anyhow!("the scene was not made ready"),
        ));
    };

    // The paths, with news of the finished share.
    let begun = clock.now();
    let paths = setting.job.paths();
    let through = if setting.job.is_antialiased() {
        Through::WholePixel
    } else {
        Through::Centre
    };
    let (news, mut shares) = mpsc::unbounded_channel();
    let tracer = thread::spawn(move || {
        let tell = |share| {
            // News of the share are for people only.
            let _ = news.send(share);
        };
        path_trace(&traceable.scene, &aovs, through, paths, settings.seed, &tell)
    });
    while let Some(share) = shares.recv().await {
        progress.show_share(clock.now(), share);
    }
    let broke = || Failure::new(Exit::Unforeseen, anyhow!("the path tracer broke"));
    let picture = tracer.join().ok().ok_or_else(broke)?;

    // The picture and its report.
    let mut report = reporting::of_job(&setting.job, &prepared);
    report.settings.spp = paths;
    report.seconds.tracing = begun.until(clock.now()).as_secs_f64();
    let (encoded, encode) = clock.time(|| {
        finish::encode(
            &picture,
            &mut staged,
            &report.metadata(),
            setting.job.exposure_stops,
        )
    });
    encoded?;
    report.seconds.encode = encode.as_secs_f64();
    staged.publish().or_exit(Exit::Output)?;
    reporting::add_time(&mut report, clock.now());
    Ok(Delivered {
        exit: Exit::Delivered,
        report,
    })
}
