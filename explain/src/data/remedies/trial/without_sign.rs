//! Detection of efforts without sign: a drive that reports the magnitude of the current, not its direction.

use super::{Counted, STRONG, Trial};
use crate::data::remedies::{Reading, Remedy};

/// Largest share of rows with a negative effort, by noise, and smallest share of rows with each sign of the required
/// torque ([`BOTH_SIGNS`]).
/// Chosen: single corrupt rows, a hundredth of [`BOTH_SIGNS`]; an effort with a sign is far from both.
const BELOW_ZERO: f64 = 1e-3;
const BOTH_SIGNS: f64 = 0.1;

impl Trial<'_> {
    /// Returns the joints whose effort is never negative, although the motion requires large efforts of both signs.
    pub fn without_sign(&self, model: &[f64], reading: &Reading) -> Vec<Remedy> {
        let lacks = |joint: &usize| {
            let rows = &self.rows[*joint];
            let from = self.problem.joint_rows(reading.column[*joint]).start;
            let own = self.problem.joint_rows(*joint).start;
            let noise = self.problem.white_noise[reading.column[*joint]];
            let count = rows.len() as f64;
            let below = |of: &dyn Fn(&Counted) -> f64| {
                let below = rows.iter().filter(|row| of(row) < -STRONG * noise);
                below.count() as f64
            };
            !reading.without_sign[*joint]
                && below(&|r| self.problem.measured[from + r.row]) <= BELOW_ZERO * count
                && below(&|r| model[own + r.row]) > BOTH_SIGNS * count
                && below(&|r| -model[own + r.row]) > BOTH_SIGNS * count
        };
        (0..self.problem.joints)
            .filter(lacks)
            .map(Remedy::EffortWithoutSign)
            .collect()
    }
}
