//! What an earlier life of a recorder left unfinished is repaired by its next.

use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tauscope_archive::{Damage, DamageKind, RepairError, repair_in_place, whole_file};

use crate::config::Config;
use crate::file_name::FileName;
use crate::rerun;

/// How long the end of a run waits for a repair; what is not repaired by then is by the next run.
/// Resolution: less than a recorder is given to end.
const PATIENCE: Duration = Duration::from_secs(30);
/// How often it is looked whether a repair is done.
/// Resolution: how soon the end of a run goes on.
const LOOK: Duration = Duration::from_millis(20);

/// Repairs, on a thread of their own.
pub(crate) struct Leftovers {
    thread: Option<JoinHandle<()>>,
}

impl Leftovers {
    /// Begins to repair the unfinished files of `config`'s names that nobody writes, those around alarms too: archives
    /// first, then pictures.
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
                tracing::warn!("cannot repair what runs before left: {error}");
                Self { thread: None }
            }
        }
    }

    /// Gives what is being repaired some time to be done.
    pub fn wait(&mut self) {
        let Some(thread) = self.thread.take() else {
            return;
        };
        let begun = Instant::now();
        while !thread.is_finished() {
            if begun.elapsed() > PATIENCE {
                tracing::warn!(
                    "an archive of a run before is not repaired yet: the next run does it"
                );
                return;
            }
            std::thread::sleep(LOOK);
        }
    }
}

/// The unfinished files of these names that nobody writes.
fn unattended(names: &[&PathBuf], cell: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for name in names {
        // A name that is none keeps the recorder from beginning, and is told there.
        let Ok(name) = FileName::parse(name) else {
            continue;
        };
        match name.all_like(cell, ".part") {
            Ok(mut parts) => found.append(&mut parts),
            Err(error) => {
                tracing::warn!("cannot look for unfinished files of runs before: {error}");
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
            "{shown}, which a run before left unfinished, is not repaired: that needs {needed_mb:.0} MB \
             of room, and {free_mb:.0} MB are left"
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
                "{shown}, which a run before left unfinished, was repaired: {path}, {messages} messages"
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
        // Another recorder of these names was first.
        Err(RepairError::BeingWritten { .. }) => {}
        Err(error) => tracing::warn!(
            "{shown}, which a run before left unfinished, cannot be repaired: {error}"
        ),
    }
}

fn picture(part: &Path) {
    let shown = part.display();
    match rerun::repair_in_place(part) {
        Ok(Some(path)) => {
            let path = path.display();
            tracing::warn!("{shown}, which a run before left unfinished, was repaired: {path}");
        }
        // Another recorder of these names was first.
        Ok(None) => {}
        Err(error) => tracing::warn!(
            "{shown}, which a run before left unfinished, cannot be repaired: {error}"
        ),
    }
}
