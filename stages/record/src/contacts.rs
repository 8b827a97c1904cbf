//! The contacts of all detectors that a recorder listens to: archive and pictures tell the same of each.

use tauscope_bus::command::MuteLease;
use tauscope_bus::{Contact, ContactFollower, SampleRef};

use crate::streams::Streams;

/// One follower a stream.
pub(crate) struct Contacts {
    followers: Vec<ContactFollower>,
    /// The newest mute, by cell.
    mutes: Vec<Option<MuteLease>>,
}

/// What is known of a detector's contact at a sample.
#[derive(Debug, Default)]
pub(crate) struct Told<'a> {
    /// The contact that lasts, as far as it is known by now.
    pub open: Option<&'a Contact>,
    /// The contact that ended at this sample.
    pub ended: Option<Contact>,
    /// The cell is muted.
    pub muted: bool,
}

impl Contacts {
    pub fn new(streams: &Streams) -> Self {
        Self {
            followers: vec![ContactFollower::default(); streams.all.len()],
            mutes: vec![None; streams.cells.len()],
        }
    }

    /// Takes a sample of the stream number `index`.
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
