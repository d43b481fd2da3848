//! The `master` program.

use clap::Parser as _;

fn main() {
    master::run::run(&master::cli::Cli::parse());
}
