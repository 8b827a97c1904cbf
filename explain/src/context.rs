//! The context that every step of an explanation shares.

use tauscope_dynamics::terms::{TermError, TermSpec};

use crate::data::other_simulation::leave_out_other_states;
use crate::data::problem::Problem;
use crate::data::track::Track;
use crate::physics::active::{Hypothesis, TimeKind};
use crate::physics::library;
use crate::read::input::Input;
use crate::read::recording::Recording;

/// The data that every step of an explanation shares.
pub struct Context<'a> {
    /// The input.
    pub input: &'a Input,
    /// Torque constants by joint \[N m/A\]; 1 where there are none.
    pub constants: &'a [f64],
    /// N m per recorded unit by joint; 1 where it is unknown.
    pub unit_nm: &'a [f64],
    /// Joints whose torque scale is unknown, each with the initial gain of the fit.
    pub unscaled: Vec<(usize, f64)>,
    /// Bodies found in addition to those of the twin. The initial terms act on their load, too.
    pub loads: Vec<TermSpec>,
    /// Stamp of the first sample of all recordings \[ns since the epoch\].
    pub session_start_ns: i64,
    /// Whether no joint moves.
    pub at_rest: bool,
    /// Delay of an external twin's effort before it was aligned with the clock of the recordings \[s\].
    pub twin_late_s: f64,
}

impl Context<'_> {
    /// Returns every hypothesis for the robot.
    pub fn hypotheses(&self) -> Vec<Hypothesis> {
        let input = self.input;
        let mut all = library::hypotheses(&input.model, input.bodies, &input.without);
        // The fit already has a free scale for such a joint.
        let unscaled = |joint: usize| self.unscaled.iter().any(|(other, _)| *other == joint);
        all.retain(|h| !h.effect.traits.is_scale || !unscaled(h.place.joint));
        if input.fit.iter().any(Recording::is_of_poses) {
            // Poses are in no order of time.
            all.retain(|h| h.time_kind() == TimeKind::Always && !h.is_of_timing());
        }
        all
    }

    /// Computes the motion of a recording and the twin's effort for it.
    ///
    /// # Errors
    /// If a term of the start cannot be built for the robot.
    pub fn track(&self, recording: &Recording, motion_cutoff_hz: f64) -> Result<Track, TermError> {
        let session_s = (recording.start_ns - self.session_start_ns) as f64 * 1e-9;
        let model = &self.input.model;
        let mut track = Track::new(
            recording,
            session_s,
            model,
            motion_cutoff_hz,
            self.constants,
        );
        if let Some(start) = &self.input.start {
            start.apply(
                &mut track,
                model,
                &self.loads,
                self.constants,
                &self.first_gains(),
            )?;
        }
        // Not for held-out recordings: their prediction comes from the motion alone.
        let fitted = self
            .input
            .fit
            .iter()
            .any(|own| std::ptr::eq(own, recording));
        if self.at_rest && fitted {
            track.start_at_measured(recording, self.unit_nm);
        }
        Ok(track)
    }

    /// Prepares recordings with the filters of those that are fitted.
    ///
    /// # Errors
    /// If a term of the start cannot be built for the robot.
    pub fn problem(
        &self,
        recordings: &[Recording],
        rests_count: &[bool],
    ) -> Result<Problem, TermError> {
        let cutoff_hz = Problem::cutoff_hz(&self.input.fit);
        let motion_cutoff_hz = Problem::motion_cutoff_hz(cutoff_hz);
        let tracks = recordings
            .iter()
            .map(|recording| self.track(recording, motion_cutoff_hz))
            .collect::<Result<Vec<_>, _>>()?;
        let mut problem = Problem::new(
            &self.input.model,
            recordings,
            tracks,
            cutoff_hz,
            self.unit_nm,
            rests_count,
        );
        problem.first_gains = self.first_gains();
        if !self.input.bodies && !self.at_rest {
            problem.is_foreign = true;
            leave_out_other_states(&mut problem);
            // The friction of the external twin is unknown.
            problem.known_friction = vec![library::any_plain_friction(); problem.joints];
        }
        if let Some(start) = &self.input.start {
            problem.states_friction = !start.was_found;
            problem.known_friction = start.friction(&self.input.model);
            if self.input.torque_constants_nm_per_a.is_none() {
                for (known, unit) in problem.known_friction.iter_mut().zip(self.unit_nm) {
                    for value in known.values_mut() {
                        *value *= unit;
                    }
                }
            }
        }
        Ok(problem)
    }

    /// Returns the initial gain of each joint's bodies, from the model's unit to that of the recording.
    fn first_gains(&self) -> Vec<f64> {
        let mut gains: Vec<f64> = self.unit_nm.iter().map(|unit| 1.0 / unit).collect();
        if !self.at_rest {
            for &(joint, gain) in &self.unscaled {
                gains[joint] = gain;
            }
        }
        gains
    }
}
