//! Queries on several machines.
fn main() {}
