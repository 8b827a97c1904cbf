//! Repair of files that an earlier run of a recorder left unfinished.

use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tauscope_archive::{Damage, DamageKind, RepairError, repair_in_place, whole_file};

use crate::config::Config;
use crate::file_name::FileName;
use crate::rerun;

/// Longest time that the end of a run waits for a repair; the next run completes it.
/// Resolution: shorter than the shutdown timeout of a recorder.
const PATIENCE: Duration = Duration::from_secs(30);
/// Poll interval for the end of a repair.
/// Resolution: delay of the end of a run.
const LOOK: Duration = Duration::from_millis(20);

/// Repairs in a separate thread.
pub(crate) struct Leftovers {
    thread: Option<JoinHandle<()>>,
}

impl Leftovers {
    /// Starts the repair of unfinished files that match the names of `config`, including those around alarms, and
    /// that no process is writing: archives first, then pictures.
    pub fn repair(config: &Config, cell: &str) -> Self {
        let [archives, pictures] = config.all_names();
        let archives = unattended(&archives, cell);
        let pictures = unattended(&pictures, cell);
        if archives.is_empty() && pictures.is_empty() {
            return Self { thread: None };
        }
        let min_free_mb = config.min_free_mb;
        let work = move || {
            archives
                .iter()
                .filter(|part| has_room(part, min_free_mb))
                .for_each(|part| archive(part));
            pictures
                .iter()
                .filter(|part| has_room(part, min_free_mb))
                .for_each(|part| picture(part));
        };
        let thread = std::thread::Builder::new().name("repair".to_owned());
        match thread.spawn(work) {
            Ok(thread) => Self {
                thread: Some(thread),
            },
            Err(error) => {
                tracing::warn!("cannot repair unfinished files of earlier runs: {error}");
                Self { thread: None }
            }
        }
    }

    /// Waits up to [`PATIENCE`] for the repairs to complete.
    pub fn wait(&mut self) {
        let Some(thread) = self.thread.take() else {
            return;
        };
        let begun = Instant::now();
        while !thread.is_finished() {
            if begun.elapsed() > PATIENCE {
                tracing::warn!(
                    "an archive of an earlier run is not repaired yet: the next run repairs it"
                );
                return;
            }
            std::thread::sleep(LOOK);
        }
    }
}

/// Unfinished files that match these names and that no process is writing.
fn unattended(names: &[&PathBuf], cell: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for name in names {
        // An invalid name prevents the start of the recorder and is reported there.
        let Ok(name) = FileName::parse(name) else {
            continue;
        };
        match name.all_like(cell, ".part") {
            Ok(mut parts) => found.append(&mut parts),
            Err(error) => {
                tracing::warn!("cannot look for unfinished files of earlier runs: {error}");
            }
        }
    }
    found.retain(|part| matches!(whole_file::is_being_written(part), Ok(false)));
    found.sort();
    found.dedup();
    found
}

fn has_room(part: &Path, min_free_mb: f64) -> bool {
    let shown = part.display();
    let needed_mb = part.metadata().map_or(0.0, |file| file.len() as f64) * 1e-6 + min_free_mb;
    let free_mb = whole_file::free_bytes(part).map_or(f64::INFINITY, |bytes| bytes as f64 * 1e-6);
    if free_mb < needed_mb {
        tracing::warn!(
            "{shown}, which an earlier run left unfinished, is not repaired: that needs {needed_mb:.0} MB \
             of free space, and {free_mb:.0} MB are free"
        );
    }
    free_mb >= needed_mb
}

fn archive(part: &Path) {
    let shown = part.display();
    match repair_in_place(part) {
        Ok(repaired) => {
            let path = repaired.written.path.display();
            let messages = repaired.written.messages;
            tracing::warn!(
                "{shown}, which an earlier run left unfinished, was repaired: {path}, {messages} messages"
            );
            let Some(aside) = &repaired.set_aside else {
                return;
            };
            let aside = aside.display();
            let more =
                |damage: &&Damage| damage.loses_data() && damage.kind != DamageKind::TornTail;
            for damage in repaired.damage.iter().filter(more) {
                tracing::warn!(
                    "{shown} is kept as {aside}, as not all of it could be read: {damage}"
                );
            }
        }
        // Another recorder with these names has started the repair.
        Err(RepairError::BeingWritten { .. }) => {}
        Err(error) => tracing::warn!(
            "{shown}, which an earlier run left unfinished, cannot be repaired: {error}"
        ),
    }
}

fn picture(part: &Path) {
    let shown = part.display();
    match rerun::repair_in_place(part) {
        Ok(Some(path)) => {
            let path = path.display();
            tracing::warn!("{shown}, which an earlier run left unfinished, was repaired: {path}");
        }
        // Another recorder with these names has started the repair.
        Ok(None) => {}
        Err(error) => tracing::warn!(
            "{shown}, which an earlier run left unfinished, cannot be repaired: {error}"
        ),
    }
}
