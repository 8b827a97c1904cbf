//! Leftovers of killed runs on this host: folders in `/tmp` and segments in `/dev/shm`.

use std::collections::BTreeSet;
use std::time::{Duration, SystemTime};
use std::{fs, io};

use iceoryx2::node::{Node, NodeState};
use iceoryx2::prelude::CallbackProgression;
use iceoryx2::service::ipc_threadsafe::Service;

use super::domain::{Domain, SEGMENTS};

/// Age below which a folder may belong to a run that is just starting, because a run creates its folder before its
/// node.
/// Resolution: shortest lifetime of leftovers.
const BEGINNING: Duration = Duration::from_mins(1);

/// Returns the domains of runs that ended without removing their files. iceoryx2 detects live processes of a domain
/// by a file lock, so this also works across containers that share `/tmp` and `/dev/shm`.
///
/// # Errors
/// If a folder cannot be read.
pub fn left_behind() -> io::Result<Vec<Domain>> {
    let mut found = BTreeSet::new();
    for entry in fs::read_dir("/tmp")? {
        let name = entry?.file_name();
        let name = name.to_string_lossy();
        found.extend(name.strip_prefix(Domain::FOLDER).map(str::to_owned));
    }
    // Segments may outlive their folder.
    if let Ok(segments) = fs::read_dir(SEGMENTS) {
        for segment in segments {
            let name = segment?.file_name();
            let domain = name.to_string_lossy();
            found.extend(domain.split_once('_').map(|(domain, _)| domain.to_owned()));
        }
    }
    let domains = found.iter().filter(|name| Domain::is_unique_name(name));
    let domains = domains.filter_map(|name| Domain::new(name).ok());
    Ok(domains.filter(is_abandoned).collect())
}

/// Removes the domains that [`left_behind`] finds and returns their number.
///
/// # Errors
/// If a domain cannot be removed, or a folder cannot be read.
pub fn remove_left_behind() -> io::Result<usize> {
    let domains = left_behind()?;
    for domain in &domains {
        domain.remove()?;
    }
    Ok(domains.len())
}

fn is_abandoned(domain: &Domain) -> bool {
    let made = fs::metadata(domain.directory()).and_then(|folder| folder.modified());
    let age = made.map(|made| SystemTime::now().duration_since(made).unwrap_or_default());
    if age.is_ok_and(|age| age < BEGINNING) {
        return false;
    }
    let Ok(config) = domain.config() else {
        return false;
    };
    let mut lives = false;
    let listed = Node::<Service>::list(&config, |node| {
        lives |= !matches!(node, NodeState::Dead(_) | NodeState::Undefined(_));
        CallbackProgression::Continue
    });
    listed.is_ok() && !lives
}
