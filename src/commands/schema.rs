//! `tauscope schema`.

use serde_json::Value;
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
    out.print(&text(args.kind)?)?;
    Ok(Exit::Done)
}

/// The schema of a kind of file.
///
/// # Errors
/// None that is known.
pub fn text(kind: FileKind) -> anyhow::Result<String> {
    let mut schema = kind.schema().to_value();
    plain_descriptions(&mut schema);
    Ok(serde_json::to_string_pretty(&schema)?)
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
