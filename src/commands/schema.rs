//! `tauscope schema`.

use serde_json::Value;
use tauscope_pipeline::files::FileKind;

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
}

/// Prints it.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let mut schema = if args.messages {
        schemars::schema_for!(tauscope_publish::message::Messages).to_value()
    } else {
        args.kind.schema().to_value()
    };
    plain_descriptions(&mut schema);
    let text = serde_json::to_string_pretty(&schema).map_err(anyhow::Error::from)?;
    out.print(&text)?;
    Ok(Exit::Done)
}

/// Descriptions come from Rust documentation, where brackets are escaped.
fn plain_descriptions(schema: &mut Value) {
    match schema {
        Value::Object(map) => {
            for (key, value) in map {
                match value {
                    Value::String(text) if key == "description" => *text = text.replace('\\', ""),
                    other => plain_descriptions(other),
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(plain_descriptions),
        _ => {}
    }
}
