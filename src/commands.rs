//! The commands, a module each: its arguments and what it does.

pub mod calibrate;
pub mod check;
pub mod evaluate;
pub mod explain;
pub mod info;
pub mod repair;
pub mod replay;
pub mod run;
pub mod schema;
pub mod simulate;
pub mod stage;

use std::io::Write;

/// Writes a result to standard output. A reader that has gone, as `head` does, is no failure.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{}", text.trim_end()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}
