//! The contacts of all detectors that a recorder listens to: archive and pictures tell the same of each.

use tauscope_bus::{Contact, ContactFollower, SampleRef};

/// One follower a stream.
pub(crate) struct Contacts {
    followers: Vec<ContactFollower>,
}

/// What is known of a detector's contact at a sample.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Told<'a> {
    /// The contact that lasts, as far as it is known by now.
    pub open: Option<&'a Contact>,
    /// The contact that ended at this sample.
    pub ended: Option<Contact>,
}

impl Contacts {
    pub fn new(streams: usize) -> Self {
        let followers = vec![ContactFollower::default(); streams];
        Self { followers }
    }

    /// Takes a sample of the stream number `index`.
    pub fn push(&mut self, index: usize, sample: SampleRef<'_>) -> Told<'_> {
        let SampleRef::Detection(detection) = sample else {
            return Told::default();
        };
        let follower = &mut self.followers[index];
        let ended = follower.push(detection);
        Told {
            open: follower.open(),
            ended,
        }
    }
}
