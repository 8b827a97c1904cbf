//! `tauscope completions`.

use clap_complete::Shell;

use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Print a script that completes commands and options in a shell.
///
/// For bash: `tauscope completions bash > ~/.local/share/bash-completion/completions/tauscope`
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

/// Prints it for the `program`'s command line.
pub fn run(args: &Args, mut program: clap::Command, out: &mut Output) -> Result<Exit, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(
        args.shell,
        &mut program,
        env!("CARGO_PKG_NAME"),
        &mut script,
    );
    out.print(String::from_utf8_lossy(&script).trim_end())?;
    Ok(Exit::Done)
}
