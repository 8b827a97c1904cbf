//! What made an archive: versions, and hashes of the files that went in.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::pipeline::Pipeline;

/// For the metadata of everything that `pipeline` records.
pub fn of(pipeline: &Pipeline) -> BTreeMap<String, String> {
    let mut all = BTreeMap::from([
        ("tauscope".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        (
            "pipeline_sha256".to_owned(),
            sha256(pipeline.text.as_bytes()),
        ),
    ]);
    for (name, cell) in &pipeline.cells {
        if let Some(urdf) = &cell.facts.urdf {
            all.insert(format!("cells/{name}/urdf_sha256"), sha256(urdf.as_bytes()));
        }
    }
    for (stage, hash) in &pipeline.model_sha256 {
        all.insert(format!("stages/{stage}/twin_sha256"), hash.clone());
    }
    all
}

/// SHA-256 of a file, or of all files of a bag's folder in the order of their names, in hexadecimal.
pub fn sha256_of_file(path: &Path) -> anyhow::Result<String> {
    let mut files = vec![path.to_owned()];
    if path.is_dir() {
        let entries = std::fs::read_dir(path)?.collect::<Result<Vec<_>, _>>()?;
        files = entries
            .into_iter()
            .map(|entry| entry.path())
            .filter(|p| p.is_file())
            .collect();
        files.sort();
    }
    let mut hash = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    for file in files {
        let mut file = File::open(&file)?;
        loop {
            let count = file.read(&mut buffer)?;
            if count == 0 {
                break;
            }
            hash.update(&buffer[..count]);
        }
    }
    Ok(hex(&hash.finalize()))
}

/// SHA-256 in hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}
