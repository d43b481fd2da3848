//! Writes the manual pages and the shell completions of the programs into a folder, for the packages:
//! `cargo run -p manuals -- FOLDER`.
//!
//! Made of the command lines themselves, so they cannot differ from what `--help` says. The programs are
//! called what the packages call them.

use std::{env, fs, io, path::Path};

use anyhow::Context as _;
use clap::{Command, CommandFactory as _};
use clap_complete::{Shell, generate_to};

const SHELLS: [Shell; 3] = [Shell::Bash, Shell::Zsh, Shell::Fish];

fn main() -> anyhow::Result<()> {
    let folder = env::args_os()
        .nth(1)
        .context("say where to write: manuals FOLDER")?;
    let folder = Path::new(&folder);
    write(folder).with_context(|| format!("cannot write to {}", folder.display()))
}

fn programs() -> [Command; 2] {
    [
        master::cli::Cli::command().name("gridlight-master"),
        worker::cli::command().name("gridlight-worker"),
    ]
}

/// Writes `man/PROGRAM.1`, with pages for its subcommands, and `completions/` for each shell.
fn write(folder: &Path) -> io::Result<()> {
    let (pages, completions) = (folder.join("man"), folder.join("completions"));
    fs::create_dir_all(&pages)?;
    fs::create_dir_all(&completions)?;
    for program in programs() {
        let name = program.get_name().to_owned();
        for shell in SHELLS {
            generate_to(shell, &mut program.clone(), &name, &completions)?;
        }
        clap_mangen::generate_to(program, &pages)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_is_in_the_manual_page_and_in_each_shells_completions() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path()).unwrap();
        let read = |file: String| fs::read_to_string(folder.path().join(file)).unwrap();
        for program in programs() {
            let name = program.get_name();
            // In roff a hyphen that may be copied is escaped.
            let page = read(format!("man/{name}.1")).replace("\\-", "-");
            let [bash, zsh] =
                [format!("{name}.bash"), format!("_{name}")].map(|file| read(format!("completions/{file}")));
            let fish = read(format!("completions/{name}.fish"));
            let flags = program.get_arguments().filter(|flag| !flag.is_hide_set());
            let names: Vec<&str> = flags.filter_map(clap::Arg::get_long).collect();
            assert!(names.len() > 3, "{name} has flags");
            for flag in names {
                assert!(page.contains(&format!("--{flag}")), "{name}.1: {flag}");
                for completion in [&bash, &zsh] {
                    assert!(completion.contains(&format!("--{flag}")), "{name}: {flag}");
                }
                assert!(fish.contains(&format!("-l {flag}")), "{name}: {flag}");
            }
        }
    }
}
