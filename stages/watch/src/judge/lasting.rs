//! Checks whether a change persists since its onset, and whether its onset was observed.

use super::super::blocks::Ring;
use super::super::moments::Compared;
use super::super::usual::Usual;
use super::{Candidate, Judge, Name};

/// Parts of the time since the change, each of which must contain its share of the change. Parts with too little
/// information are joined.
/// Chosen: parts of 2 to 2.5 s at a report; shorter ones hold little information, longer ones do not show that a
/// contact ended.
const PARTS: usize = 4;
/// Admissible share of a change in each part; 1 is the whole change.
/// Tuned: by hand, on no recorded seeds; not swept.
const SHARE: std::ops::RangeInclusive<f64> = 0.4..=2.2;
/// Minimum number of parts with enough information.
/// Statistical: a single part cannot show that the change lasts.
const LEAST_PARTS: usize = 2;
/// Newest blocks that must contain their share of the change by themselves.
/// Tuned: by hand, on no recorded seeds; not swept.
const NEWEST: usize = 2;
/// Standard error of a part's share below which the part has enough information.
/// Statistical: the least admissible share, 0.4, is then three standard errors below the whole change.
const UNCERTAIN: f64 = 0.2;
/// Minimum and maximum number of blocks before the change in which its onset is checked.
/// Tuned: by hand, on no recorded seeds; not swept.
const BEFORE: (usize, usize) = (3, 8);

impl Judge {
    /// Returns whether each part of the time since the change contains its share of it, the newest included. A
    /// contact that ended or moved does not pass.
    pub(super) fn lasts(&mut self, ring: &Ring, usual: &Usual<'_>, first: &Candidate) -> bool {
        let blocks = (0..=first.best.back).filter(|&back| !ring.back(back).excluded);
        let per_part = first.best.blocks.div_ceil(PARTS);
        let mut telling = 0;
        self.window.clear();
        // A contact that just ended shows in the newest blocks first, or in as many as have enough information.
        for (at, back) in blocks.clone().enumerate() {
            self.window.add(ring.back(back));
            if at + 1 < NEWEST {
                continue;
            }
            match self.share(usual, first) {
                Some(share) if share < *SHARE.start() => return false,
                Some(_) => break,
                None if 2 * at > first.best.blocks => return false,
                None => {}
            }
        }
        self.window.clear();
        for (at, back) in blocks.enumerate() {
            self.window.add(ring.back(back));
            if self.window.blocks < per_part && at + 1 < first.best.blocks {
                continue;
            }
            // A part with too little information is joined with the preceding one.
            if let Some(share) = self.share(usual, first) {
                telling += 1;
                if !SHARE.contains(&share) {
                    return false;
                }
                self.window.clear();
            }
        }
        telling >= LEAST_PARTS
    }

    /// Returns whether the onset of the change was observed: the blocks before it contain little of it. Otherwise the
    /// arm has drifted from the reference.
    pub(super) fn began(&mut self, ring: &Ring, usual: &Usual<'_>, first: &Candidate) -> bool {
        self.window.clear();
        for back in first.best.back + 1..ring.len() {
            let block = ring.back(back);
            if !block.excluded && self.window.blocks < BEFORE.1 {
                self.window.add(block);
            }
        }
        let share = self.share(usual, first);
        self.window.blocks >= BEFORE.0 && share.is_none_or(|share| share < *SHARE.start())
    }

    /// Returns the share of the change that the window contains; `None` if the window has too little information.
    fn share(&mut self, usual: &Usual<'_>, first: &Candidate) -> Option<f64> {
        let (share, information, noise) = match first.name {
            Name::Joint(j, kind) => {
                let compared = Compared::new(&self.window.own[j], &usual.references[j])?;
                let (share, information) = compared.share(kind, first.best.size);
                (share, information, usual.noise[j]?)
            }
            Name::Payload => {
                let window = &self.window;
                let score = window.scores(usual.references, usual.noise, &mut self.scores);
                let (share, information) = score.share(&self.payload_change);
                (share, information, 1.0)
            }
        };
        (information > noise / (UNCERTAIN * UNCERTAIN)).then_some(share)
    }
}
