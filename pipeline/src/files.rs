//! User-written kinds of file, one type each. `tauscope schema` prints their schemas and `tauscope check --kind`
//! checks them.

mod case;
mod keys;
mod set;

use std::path::Path;

use schemars::{JsonSchema, Schema};
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::pipeline::PipelineFile;
use crate::report::Report;
use crate::yaml;

pub use case::CaseFile;
pub use set::{Impedance, SetFile};

/// A kind of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum FileKind {
    /// A pipeline, which `tauscope run` runs.
    #[default]
    Pipeline,
    /// A corrected twin, which `tauscope calibrate` writes.
    Twin,
    /// A scenario, which `tauscope simulate` simulates.
    Scenario,
    /// A robot and recordings for `tauscope explain`.
    Case,
    /// Labelled recordings for `tauscope evaluate`.
    Set,
}

impl FileKind {
    /// JSON Schema of the file.
    pub fn schema(self) -> Schema {
        match self {
            Self::Pipeline => schemars::schema_for!(PipelineFile),
            Self::Twin => schemars::schema_for!(tauscope_twin::TwinFile),
            Self::Scenario => schemars::schema_for!(tauscope_ingest::simulated::Scenario),
            Self::Case => schemars::schema_for!(CaseFile),
            Self::Set => schemars::schema_for!(SetFile),
        }
    }

    /// Schema as a text for editors.
    pub fn schema_text(self) -> String {
        text_of_schema(&self.schema())
    }

    /// All keys as Markdown tables below headings of the third level.
    pub fn keys_text(self) -> String {
        keys::keys(&self.schema().to_value(), 3)
    }

    /// Checks the shape of the file at `path`.
    ///
    /// # Errors
    /// All errors, each with its place.
    pub fn check_shape(self, path: &Path) -> Result<(), Report> {
        fn of<T: DeserializeOwned + JsonSchema>(path: &Path) -> Result<(), Report> {
            yaml::load::<T>(path).map(|_| ())
        }
        match self {
            Self::Pipeline => of::<PipelineFile>(path),
            Self::Twin => of::<tauscope_twin::TwinFile>(path),
            Self::Scenario => of::<tauscope_ingest::simulated::Scenario>(path),
            Self::Case => of::<CaseFile>(path),
            Self::Set => of::<SetFile>(path),
        }
    }
}

/// Schema as formatted text.
pub fn text_of_schema(schema: &Schema) -> String {
    let mut schema = schema.clone().to_value();
    plain_descriptions(&mut schema);
    format!("{schema:#}")
}

/// Removes the backslashes that escape brackets in Rust documentation, the source of the descriptions.
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
