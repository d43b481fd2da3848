//! The `eval` program.

fn main() {}
