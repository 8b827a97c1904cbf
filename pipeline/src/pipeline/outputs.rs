//! Check that recorders write to distinct files, and not to files that sources read.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::file::PipelineFile;
use super::stage::check::Check;
use super::stage::entry::stage_place;
use crate::yaml::{Located, Place};

/// Checks that no two recorders write to the same file, and that none writes to a file that a source reads:
/// either would corrupt the file.
pub fn check(check: &mut Check<'_>) {
    let mut taken: BTreeMap<(Option<&str>, PathBuf), (Place, String)> = BTreeMap::new();
    for index in 0..check.file.value.stages.len() {
        let entry = check.entry(index);
        let Some(mut config) = entry.config::<tauscope_ingest::Config>().cloned() else {
            continue;
        };
        let place = stage_place(index).key("ingest");
        if let Some(path) = config.path_mut() {
            let key = (entry.host.as_deref(), plain(check.file, path));
            taken.insert(key, (place.clone(), format!("`{}` reads it", entry.name)));
        }
    }
    for index in 0..check.file.value.stages.len() {
        let entry = check.entry(index);
        let Some(config) = entry.config::<tauscope_record::Config>() else {
            continue;
        };
        let place = stage_place(index).key("record");
        let outputs = [
            (config.mcap.clone(), place.key("mcap")),
            (
                config.rerun.as_ref().and_then(|rerun| rerun.file.clone()),
                place.key("rerun").key("file"),
            ),
        ];
        for (path, place) in outputs {
            let Some(path) = path else { continue };
            let key = (entry.host.as_deref(), plain(check.file, &path));
            if let Some((other, label)) = taken.get(&key) {
                let title = format!("`{}` would overwrite {}", entry.name, path.display());
                let problem = check.file.at(&place, title);
                check.push(problem.also(check.file.key_span(other), label.clone()));
                continue;
            }
            taken.insert(key, (place, format!("`{}` writes it", entry.name)));
        }
    }
}

/// The absolute path without `.` and `..`, resolved without access to the file system.
fn plain(file: &Located<PipelineFile>, path: &Path) -> PathBuf {
    let path = std::path::absolute(file.resolve(path)).unwrap_or_else(|_| path.to_owned());
    path.components().fold(PathBuf::new(), |mut plain, part| {
        match part {
            std::path::Component::ParentDir => {
                plain.pop();
            }
            other => plain.push(other),
        }
        plain
    })
}
