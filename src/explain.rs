//! `tauscope explain` around the engine: from a case or arguments to the engine's input, and from its outcome to
//! files.

mod input;
mod output;
mod picture;
mod read;
mod served;
mod twin;
mod words;

use std::collections::BTreeMap;
use std::path::Path;

use tauscope_archive::whole_file::{self, Existing};
use tauscope_pipeline::provenance;
use tauscope_pipeline::report::Problem;

use crate::exit::Failure;

pub use input::{Arguments, Named, Request, from_arguments, from_case, without};
pub use output::{json, make, refuse_to_replace, write};
pub use read::{Kept, read};
pub use words::text;

/// Returns sentences about the robot file: which of its numbers are replaced, and which joints are made `fixed`.
pub fn of_robot(request: &Request) -> Vec<String> {
    let findings = request.cell.findings.iter().cloned();
    findings.chain(request.note.clone()).collect()
}

/// Returns names and hashes of the inputs. The robot's hash is that of its file; the text that was used may differ
/// ([`of_robot`]).
fn provenance_of(request: &Request) -> std::io::Result<BTreeMap<String, String>> {
    let version = env!("CARGO_PKG_VERSION").to_owned();
    let mut all = BTreeMap::from([("tauscope".to_owned(), version)]);
    if let Some(path) = &request.robot_path {
        let hash = provenance::sha256_of_file(path)?;
        all.insert("urdf_sha256".to_owned(), hash);
        all.insert("robot".to_owned(), path.display().to_string());
    }
    if let Some(start) = &request.start {
        all.insert(
            "twin_sha256".to_owned(),
            provenance::sha256_of_file(&start.path)?,
        );
    }
    for (role, recordings) in [("fit", &request.fit), ("holdout", &request.holdout)] {
        for recording in recordings {
            let hash = provenance::sha256_of_file(&recording.path)?;
            all.insert(format!("{role}/{}", recording.name), hash);
        }
    }
    Ok(all)
}

/// Writes a file, whole or not at all.
fn write_whole(path: &Path, content: &[u8]) -> Result<(), Failure> {
    whole_file::write(path, content, Existing::Replace).map_err(|error| {
        Failure::Rejected(Problem::of_file(path, format!("cannot write: {error}")).into())
    })
}
