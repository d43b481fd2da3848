//! The program's table of contents: from the command line to the delivered picture.

use std::{
    io::{self, Write},
    mem::ManuallyDrop,
    path::Path,
};

use anyhow::Context as _;
use indicatif::MultiProgress;
use protocol::key_file;

use crate::{
    cli::{Cli, Command, Integrator, KeygenArgs, RenderArgs},
    clock::Clock,
    deliver::StagedFile,
    exit::{Exit, Failure, OrExit},
    job::Job,
    local_worker, logging,
    process_age::process_age,
    progress::Progress,
    reference,
    report::Report,
    server,
    session::{Session, Setting},
    warm,
};

/// Does what the command line says and ends the process.
///
/// The end is immediate: the deadline holds for whoever waits for this process, and tearing down what
/// the operating system will tear down anyway, Embree's threads and tables too, would be paid out of it.
pub fn run(cli: &Cli) -> ! {
    let clock = Clock::new(process_age());
    let bars = MultiProgress::new();
    let exit = match &cli.command {
        Some(Command::Worker(args)) => {
            logging::start(false, 0, &bars);
            local_worker::run(*args)
                .or_exit(Exit::Unforeseen)
                .map(|()| Exit::Delivered)
        }
        Some(Command::Warm(args)) => {
            logging::start(false, 1, &bars);
            warm::run(args, clock)
        }
        Some(Command::Keygen(args)) => keygen(args).map(|()| Exit::Delivered),
        None => {
            logging::start(cli.render.quiet, cli.render.verbose, &bars);
            render(&cli.render, clock, &bars)
        }
    };
    let exit = exit.unwrap_or_else(|failure| {
        // What cannot be said cannot be helped.
        let _ = writeln!(io::stderr(), "error: {}", sentence(&failure.error));
        failure.exit
    });
    worker::exit::at_once(exit as u8)
}

/// An error with its causes, but for those that are quoted before.
fn sentence(error: &anyhow::Error) -> String {
    let mut sentence = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if sentence.is_empty() {
            sentence = cause;
        } else if !sentence.contains(&cause) {
            sentence = format!("{sentence}: {cause}");
        }
    }
    sentence
}

/// Renders a picture and delivers it with its report.
fn render(args: &RenderArgs, clock: Clock, bars: &MultiProgress) -> Result<Exit, Failure> {
    // All that can be refused is refused before anything starts.
    let job = Job::new(args)?;
    let staged = job.files.stage().context("--out").or_exit(Exit::Output)?;
    let report_file = stage_report(job.report.as_deref())?;
    server::raise_connections_max();
    let listener = server::bind(job.listen).or_exit(Exit::Listen)?;
    let mut progress = Progress::start(args.quiet, bars);
    let setting = Setting {
        job,
        clock,
        local_token: random_token().or_exit(Exit::Unforeseen)?,
    };

    // Bytes are carried by this thread; light is made by others.
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    // Memory is left for the operating system to tear down, when nobody waits any more.
    let runtime = ManuallyDrop::new(runtime.or_exit(Exit::Unforeseen)?);
    let delivered = match setting.job.integrator {
        Integrator::Vpl => {
            let session = runtime.block_on(async { Session::start(setting, listener) })?;
            let mut session = ManuallyDrop::new(session);
            let delivered = runtime.block_on(session.run(staged, &mut progress));
            session.kill_local_worker();
            delivered
        }
        Integrator::Path => runtime.block_on(reference::run(setting, staged, &mut progress)),
    }?;

    // The picture is there; say so.
    deliver_report(args.json, report_file, &delivered.report)?;
    progress.finish(&delivered.report.line());
    Ok(delivered.exit)
}

/// A picture in its place.
#[derive(Debug)]
pub struct Delivered {
    /// How the process ends.
    pub exit: Exit,
    /// What to say of it.
    pub report: Report,
}

fn stage_report(path: Option<&Path>) -> Result<Option<StagedFile>, Failure> {
    let staged = path.map(StagedFile::create).transpose();
    staged.context("--report").or_exit(Exit::Output)
}

fn deliver_report(json: bool, file: Option<StagedFile>, report: &Report) -> Result<(), Failure> {
    let text = report.to_json();
    if let Some(mut file) = file {
        let written = writeln!(file.file(), "{text}");
        written.context("cannot write the report").or_exit(Exit::Output)?;
        file.publish().or_exit(Exit::Output)?;
    }
    if json {
        let written = writeln!(io::stdout(), "{text}").and_then(|()| io::stdout().flush());
        written
            .context("cannot write the report to standard output")
            .or_exit(Exit::Output)?;
    }
    Ok(())
}

/// By this the worker that this process starts is known from others.
fn random_token() -> Result<String, getrandom::Error> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes)?;
    Ok(format!("{:032x}", u128::from_ne_bytes(bytes)))
}

/// Makes a key file and says what to do with it.
fn keygen(args: &KeygenArgs) -> Result<(), Failure> {
    let key = key_file::create(&args.out).or_exit(Exit::Key)?;
    let (path, fingerprint) = (args.out.display(), key.fingerprint());
    let said = writeln!(
        io::stdout(),
        "{path}: key {fingerprint}\nCopy it to all machines of the grid by a safe way, with mode 0600, and name \
         it there with --key FILE.",
    );
    said.or_exit(Exit::Unforeseen)
}
