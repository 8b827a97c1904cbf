//! The `tauscope` program.
fn main() {}
