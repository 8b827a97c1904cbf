//! Contacts of all detectors that a recorder listens to, shared by archive and pictures.

use tauscope_bus::command::MuteLease;
use tauscope_bus::{Contact, ContactFollower, SampleRef};

use crate::streams::Streams;

/// Contact followers, one per stream.
pub(crate) struct Contacts {
    followers: Vec<ContactFollower>,
    /// Latest mute by cell.
    mutes: Vec<Option<MuteLease>>,
}

/// A detector's contact at a sample.
#[derive(Debug, Default)]
pub(crate) struct Told<'a> {
    /// The current contact with its estimate so far.
    pub open: Option<&'a Contact>,
    /// The contact that ended at this sample.
    pub ended: Option<Contact>,
    /// Whether the cell is muted.
    pub muted: bool,
}

impl Contacts {
    pub fn new(streams: &Streams) -> Self {
        Self {
            followers: vec![ContactFollower::default(); streams.all.len()],
            mutes: vec![None; streams.cells.len()],
        }
    }

    /// Processes a sample of the stream number `index`.
    pub fn push(&mut self, streams: &Streams, index: usize, sample: SampleRef<'_>) -> Told<'_> {
        let mute = &mut self.mutes[streams.all[index].cell];
        let detection = match sample {
            SampleRef::Detection(detection) => detection,
            SampleRef::JointState(state) => {
                *mute = MuteLease::of(state.header.stamp_ns, &state.command).or(*mute);
                return Told::default();
            }
            _ => return Told::default(),
        };
        let muted = mute.is_some_and(|mute| mute.holds(detection.header.stamp_ns));
        let follower = &mut self.followers[index];
        let ended = follower.push(detection);
        Told {
            open: follower.open(),
            ended,
            muted,
        }
    }
}
