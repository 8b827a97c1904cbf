//! `tauscope schema`.

use tauscope_pipeline::files::{self, FileKind};
use tauscope_publish::message::Messages;

use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Print the JSON Schema of the pipeline file, or of another kind of file, for editors that complete
/// and check it; or of the JSON messages.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which kind of file.
    #[arg(value_enum, default_value_t)]
    kind: FileKind,
    /// Instead, of the JSON messages that a publisher publishes and a source takes.
    #[arg(long, conflicts_with = "kind")]
    messages: bool,
    /// Instead, all keys of that kind of file, as Markdown tables.
    #[arg(long, conflicts_with = "messages")]
    keys: bool,
}

/// Prints it.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    out.print(&if args.messages {
        files::text_of_schema(&schemars::schema_for!(Messages))
    } else if args.keys {
        args.kind.keys_text()
    } else {
        args.kind.schema_text()
    })?;
    Ok(Exit::Done)
}
