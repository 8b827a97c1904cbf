//! Efforts that drop to exactly zero now and then: a loose plug, or a driver that fills in what it did not receive.

use std::collections::BTreeMap;

use tauscope_session::Finding;

use super::{Remedy, Slip};
use crate::read::recording::Recording;

/// The joints whose effort drops out, with the number of messages of all recordings in which it does. Their rows were
/// left out on reading, so nothing is to be mended.
pub fn of_dropouts(recordings: &[Recording], joints: &[String]) -> Vec<Slip> {
    let mut messages: BTreeMap<usize, u64> = BTreeMap::new();
    for finding in recordings.iter().flat_map(|recording| &recording.findings) {
        if let Finding::Dropouts { joint, times } = finding
            && let Some(at) = joints.iter().position(|name| name == joint)
        {
            *messages.entry(at).or_default() += times.messages;
        }
    }
    let slip = |(joint, messages)| Slip {
        remedy: Remedy::DropsOut(joint, messages),
        mended: Vec::new(),
        share: 0.0,
        slopes: Vec::new(),
    };
    messages.into_iter().map(slip).collect()
}
