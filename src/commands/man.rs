//! `tauscope man`.

use std::path::{Path, PathBuf};

use anyhow::Context as _;

use crate::existing::Force;
use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Write the manual pages: `tauscope.1` and one for each command.
///
/// Read a page with `man DIR/tauscope-run.1`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder for the pages.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
}

/// Writes the pages for the command line of `program`.
pub fn run(args: &Args, mut program: clap::Command, out: &mut Output) -> Result<Exit, Failure> {
    program.build();
    let pages = pages(&program).context("cannot make the pages")?;
    args.force
        .check(pages.iter().map(|(name, _)| args.out.join(name)))?;
    std::fs::create_dir_all(&args.out).map_err(|error| {
        Failure::rejected(format!("cannot make {}: {error}", args.out.display()))
    })?;
    for (name, page) in &pages {
        let path = args.out.join(name);
        write(&path, page)?;
        out.print(&format!("wrote {}", path.display()))?;
    }
    Ok(Exit::Done)
}

fn write(path: &Path, page: &[u8]) -> anyhow::Result<()> {
    std::fs::write(path, page).with_context(|| format!("cannot write {}", path.display()))
}

/// Returns name and text of the program's page and of each command's.
fn pages(program: &clap::Command) -> std::io::Result<Vec<(String, Vec<u8>)>> {
    let commands = program.get_subcommands().filter(|command| {
        // Hidden commands are internal; clap's own `help` repeats the pages.
        !command.is_hide_set() && command.get_name() != "help"
    });
    std::iter::once(program)
        .chain(commands)
        .map(|command| {
            let man = clap_mangen::Man::new(command.clone());
            let mut page = Vec::new();
            man.render(&mut page)?;
            Ok((man.get_filename(), page))
        })
        .collect()
}
