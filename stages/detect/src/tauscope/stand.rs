//! Standstill of an arm, and the end of a contact with a stationary arm.
//!
//! After a contact, static friction may hold a stationary arm in another equilibrium than before. The remaining
//! residual then says nothing about a contact any more. So a contact is over once it has lost most of its size, along
//! its own direction, for a while. The remaining residual is the new zero until the arm moves. A contact also counts
//! as over if a hand releases most of its force and keeps the rest constant.

use tauscope_bus::{JointArray, MAX_JOINTS, TwinState};

use crate::frame::DEFAULT_HOLD_S;

/// Highest speed of a stationary joint \[rad/s, m/s\].
/// Chosen: 30 times the noise of encoders (0.001 rad/s), so that no outlier ends a standstill. A higher speed treats
/// slow motion, in which friction still changes, as standstill.
pub(super) const STILL_RAD_S: f64 = 0.03;
/// Largest displacement of a joint at standstill \[rad, m\]. The joint's speed must also stay below `slow`.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const WITHIN: f64 = 0.01;
/// Time for which both must hold until the arm counts as stationary \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const STANDS_AFTER_S: f64 = 1.5;
/// Share of a contact below which it is over.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const LEFT: f64 = 0.35;
/// Largest recent change of the remaining residual for the contact to be over, as a share of the contact.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const STEADY: f64 = 0.05;

/// Detects standstill of the arm.
#[derive(Debug)]
pub(super) struct Stand {
    slow: f64,
    at: JointArray,
    since_ns: Option<i64>,
}

impl Stand {
    /// Creates a detection for an arm whose joints are no faster than `slow` at standstill \[rad/s, m/s\].
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

    /// Takes the next sample and returns whether the arm is stationary.
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
    /// Contact at its largest, in units of noise, and the time since which it appears to be over.
    largest: JointArray,
    over_since_ns: Option<i64>,
}

impl End {
    /// Forgets the present contact.
    pub fn forget(&mut self) {
        self.largest = [0.0; MAX_JOINTS];
        self.over_since_ns = None;
    }

    /// Returns the squared length of the contact at its largest.
    pub fn whole(&self) -> f64 {
        product(&self.largest, &self.largest)
    }

    /// Takes the present residual of the contact, and its recent change `changed`, both in units of noise. Returns
    /// whether the contact is over.
    pub fn step(&mut self, now_ns: i64, units: &JointArray, changed: &JointArray) -> bool {
        if product(units, units) > self.whole() {
            self.largest = *units;
        }
        let lasts = product(&self.largest, units) >= LEFT * self.whole();
        if lasts || product(changed, changed) > STEADY.powi(2) * self.whole() {
            self.over_since_ns = None;
            return false;
        }
        // Both conditions must hold for a while.
        let since_ns = *self.over_since_ns.get_or_insert(now_ns);
        (now_ns - since_ns) as f64 * 1e-9 >= DEFAULT_HOLD_S
    }
}
