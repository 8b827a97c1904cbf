//! `tauscope schema`.

use tauscope_pipeline::files::FileKind;

use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Print the JSON Schema of the pipeline file, or of another kind of file, for editors that complete
/// and check it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which kind of file.
    #[arg(value_enum, default_value_t)]
    kind: FileKind,
}

/// Prints it.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    out.print(&args.kind.schema_text())?;
    Ok(Exit::Done)
}
