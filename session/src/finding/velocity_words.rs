//! The sentence about recorded velocities that are not used.

use std::fmt;

use super::OddVelocity;
use crate::suggest;

/// Consequence of computed velocities.
pub(super) const NOISIER: &str = "Computed velocities are noisier than measured ones, so the detector finds only \
                                  stronger contacts while the arm moves";

/// Velocity over derivative of the position below which the velocity does not follow the position.
/// Resolution: a factor of a unit, such as 1/60, is far from it or is written with its digits.
const FOLLOWS: f64 = 0.01;

/// The sentence about velocities that are not the derivative of the position.
pub(super) fn velocities(
    f: &mut fmt::Formatter<'_>,
    joints: &[OddVelocity],
    all: bool,
    is_replaced: bool,
) -> fmt::Result {
    // Joints with the same words share a clause.
    let mut clauses: Vec<(&OddVelocity, Vec<&str>)> = Vec::new();
    for odd in joints {
        let is_same = |(known, _): &&mut (&OddVelocity, _)| known.words(true) == odd.words(true);
        match clauses.iter_mut().find(is_same) {
            Some((_, names)) => names.push(&odd.joint),
            None => clauses.push((odd, vec![&odd.joint])),
        }
    }
    let clauses = clauses.iter();
    let clauses: Vec<String> = clauses
        .map(|(odd, names)| {
            let of = if all && names.len() == joints.len() && names.len() > 1 {
                format!("all {} joints", names.len())
            } else {
                suggest::some(names)
            };
            format!("of {of} {}", odd.words(names.len() > 1))
        })
        .collect();
    write!(f, "the recorded velocity {}", clauses.join(", and "))?;
    if joints.iter().any(|odd| odd.slope < -FOLLOWS) {
        f.write_str("; below zero, position or velocity has the wrong sign")?;
    }
    if is_replaced {
        write!(
            f,
            ". Velocities are computed from the positions instead. {NOISIER}"
        )?;
    }
    f.write_str(". Check the velocity that the driver publishes")
}

impl OddVelocity {
    /// Words about this joint and others with the same fault, `are_several` in total.
    fn words(&self, are_several: bool) -> String {
        match self.constant {
            Some(value) => {
                let move_ = if are_several { "they move" } else { "it moves" };
                format!("is {value} in every message although {move_}")
            }
            None if self.slope.abs() < FOLLOWS => {
                "does not follow the change of the position".to_owned()
            }
            None => format!("is {:.2} times the derivative of the position", self.slope),
        }
    }
}
