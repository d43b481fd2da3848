//! The `worker` program.

fn main() {
    worker::cli::main();
}
