//! The input of an explanation: robot, recordings and the twin to start from.

use std::collections::BTreeSet;

use tauscope_dynamics::Model;

use crate::read::recording::Recording;
use crate::read::start::Start;

/// The input of an explanation.
#[derive(Debug)]
pub struct Input {
    /// Name of the case.
    pub case: String,
    /// The robot; massless joints where the twin is a topic.
    pub model: Model,
    /// Whether the robot's bodies are known. They are not if the twin is a topic.
    pub bodies: bool,
    /// Unit of the recordings' effort: `Nm` or `A`.
    pub effort_unit: String,
    /// Torque constants by joint, if the unit is `A` and they are known \[N m/A\].
    pub torque_constants_nm_per_a: Option<Vec<f64>>,
    /// Recordings that may be fitted.
    pub fit: Vec<Recording>,
    /// Held-out recordings: nothing is fitted on them.
    pub holdout: Vec<Recording>,
    /// A corrected twin to start from, if there is one.
    pub start: Option<Start>,
    /// Effects that are left out of the library.
    pub without: BTreeSet<String>,
}

/// Recordings for each one that is held out. Chosen: most of the data is fitted.
pub const FOR_ONE_HELD_OUT: usize = 4;
/// Appended to the name of a single recording's held-out end.
const LAST_PART: &str = "_last_quarter";

impl Input {
    /// The corrected twin that was found on this arm before, if it is the start.
    pub fn found_before(&self) -> Option<&Start> {
        self.start.as_ref().filter(|start| start.was_found)
    }

    /// Whether the end of the only recording is held out: there is no other, and nothing to compare it with.
    pub fn is_parted(&self) -> bool {
        self.fit.len() == 1 && self.holdout.is_empty() && self.found_before().is_none()
    }

    /// Holds out a quarter of the recordings to fit, those of middle travel; the end of a single recording.
    pub fn hold_out_some(&mut self) {
        if self.is_parted()
            && let Some(only) = self.fit.pop()
        {
            let at_s = only.duration_s() * (1.0 - 1.0 / FOR_ONE_HELD_OUT as f64);
            let (begin, mut end) = only.parted(at_s);
            end.name += LAST_PART;
            self.fit.push(begin);
            self.holdout.push(end);
            return;
        }
        let joints = self.model.dof();
        let held_out = of_middle_travel(&self.fit, joints);
        let all = std::mem::take(&mut self.fit).into_iter().enumerate();
        for (index, recording) in all {
            let part = if held_out.contains(&index) {
                &mut self.holdout
            } else {
                &mut self.fit
            };
            part.push(recording);
        }
    }
}

/// A quarter of some recordings, rounded up: those whose joints move neither least nor most, so that neither a standing arm
/// nor the liveliest motion is kept from the fit. One recording is not parted.
fn of_middle_travel(recordings: &[Recording], joints: usize) -> Vec<usize> {
    let travels: Vec<f64> = recordings.iter().map(|r| travel(r, joints)).collect();
    let count = travels.len();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| travels[a].total_cmp(&travels[b]));
    let held_out = count.div_ceil(FOR_ONE_HELD_OUT).min(count / 2);
    order[(count - held_out) / 2..][..held_out].to_vec()
}

/// Total travel of the joints \[rad or m\].
fn travel(recording: &Recording, joints: usize) -> f64 {
    let rows: Vec<&[f64]> = recording.position.chunks_exact(joints).collect();
    let steps = rows.windows(2).map(|pair| {
        let joints = pair[0].iter().zip(pair[1]);
        joints
            .map(|(before, after)| (after - before).abs())
            .sum::<f64>()
    });
    steps.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{model, recording};

    #[test]
    fn the_end_of_a_single_recording_answers_its_own_rows_only() {
        let whole = recording(&model(), 1, |_, _, _| {});
        let at_s = 0.75 * whole.duration_s();
        let (begin, end) = whole.clone().parted(at_s);
        assert_eq!(begin.len() + end.len(), whole.len());
        assert!(begin.duration_s() < at_s && end.time_s[0] == 0.0);
        let rows = begin.sample_of_row.iter().zip(&end.sample_of_row);
        assert!(rows.clone().all(|(a, b)| a.is_some() != b.is_some()));
        assert_eq!(end.sample_of_row.last(), Some(&Some(end.len() - 1)));
        assert_eq!(
            end.position,
            whole.position[begin.position.len()..].to_vec()
        );
    }

    #[test]
    fn a_standing_arm_and_the_liveliest_motion_are_fitted() {
        let with_scale = |scale: f64| {
            let mut recording = recording(&model(), 1, |_, _, _| {});
            recording.position.iter_mut().for_each(|q| *q *= scale);
            recording
        };
        let all = [0.0, 2.0, 1.0, 0.5, 0.7].map(with_scale);
        let held_out = |count: usize| of_middle_travel(&all[..count], model().dof());
        assert_eq!(held_out(1), [0_usize; 0]);
        assert_eq!(held_out(4), [3]);
        assert_eq!(held_out(5), [3, 4]);
    }
}
