//! Whether an arm stands, and when a contact with one that stands is over.
//!
//! Static friction lets a standing arm go back to another balance than it had: what is left of the residual says nothing of a contact any more. So where
//! it has lost most of what the contact was, along the contact, for a while, the contact is over, and what is left is where the arm stands now, until
//! it moves. A hand that lets go of most of its force and keeps the rest where it is counts as gone.

use tauscope_bus::{JointArray, MAX_JOINTS, TwinState};

/// An arm stands once no joint has been further than this from where it was \[rad, m\], nor faster than `slow`.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const WITHIN: f64 = 0.01;
/// For so long \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const STANDS_AFTER_S: f64 = 1.5;
/// A contact is over where less than this share of it is left.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const LEFT: f64 = 0.35;
/// And what is left changes by no more than this share of it.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const STEADY: f64 = 0.05;
/// For so long \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const OVER_AFTER_S: f64 = 0.1;

/// Tells whether the arm stands.
#[derive(Debug)]
pub(super) struct Stand {
    slow: f64,
    at: JointArray,
    since_ns: Option<i64>,
}

impl Stand {
    /// Of an arm whose joints are no faster than `slow` while it stands \[rad/s, m/s\].
    pub fn new(slow: f64) -> Self {
        Self {
            slow,
            at: [0.0; MAX_JOINTS],
            since_ns: None,
        }
    }

    pub fn reset(&mut self) {
        self.since_ns = None;
    }

    /// Takes the next sample; whether the arm stands.
    pub fn step(&mut self, sample: &TwinState, joints: usize) -> bool {
        let now_ns = sample.header.stamp_ns;
        let away = |(q, at): (&f64, &f64)| (q - at).abs() > WITHIN;
        let moves = sample.position[..joints].iter().zip(&self.at).any(away)
            || sample.velocity[..joints]
                .iter()
                .any(|v| v.abs() > self.slow);
        match self.since_ns {
            Some(since_ns) if !moves => (now_ns - since_ns) as f64 * 1e-9 >= STANDS_AFTER_S,
            _ => {
                self.at = sample.position;
                self.since_ns = Some(now_ns);
                false
            }
        }
    }
}

fn product(a: &JointArray, b: &JointArray) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Follows a contact to its end.
#[derive(Debug, Default)]
pub(super) struct End {
    /// The contact where it was largest, in units of noise; since when it seems to be over.
    largest: JointArray,
    over_since_ns: Option<i64>,
}

impl End {
    /// No contact goes on.
    pub fn forget(&mut self) {
        self.largest = [0.0; MAX_JOINTS];
        self.over_since_ns = None;
    }

    /// Squared length of the contact where it was largest.
    pub fn whole(&self) -> f64 {
        product(&self.largest, &self.largest)
    }

    /// Takes what there is of the contact now, and how that has `changed` of late, both in units of noise; whether it is over.
    pub fn step(&mut self, now_ns: i64, units: &JointArray, changed: &JointArray) -> bool {
        if product(units, units) > self.whole() {
            self.largest = *units;
        }
        let lasts = product(&self.largest, units) >= LEFT * self.whole();
        if lasts || product(changed, changed) > STEADY.powi(2) * self.whole() {
            self.over_since_ns = None;
            return false;
        }
        let since_ns = *self.over_since_ns.get_or_insert(now_ns);
        (now_ns - since_ns) as f64 * 1e-9 >= OVER_AFTER_S
    }
}
