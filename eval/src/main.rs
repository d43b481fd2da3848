//! The `eval` program: judges pictures.

fn main() -> std::process::ExitCode {
    let cli = eval::cli::parse();
    let outcome = eval::cli::run(cli);
    eval::cli::exit_code(outcome)
}
