//! The corrected twin: its terms and gains, including the initial ones.

use tauscope_dynamics::terms::{Layer, Site, TermSpec};

use crate::context::Context;
use crate::fit::fitted::Fit;
use crate::physics::active::{Active, TimeKind};
use crate::physics::{friction, torque_scale};

impl Context<'_> {
    /// Returns the gain of each joint's bodies in the corrected twin, and its standard deviation. `fitted` are the
    /// standard deviations of the fitted gains.
    pub fn final_gains(&self, found: &Fit, fitted: &[(usize, f64)]) -> (Vec<f64>, Vec<f64>) {
        let n = self.unit_nm.len();
        let start = self.input.start.as_ref();
        let mut gain = start.map_or_else(|| vec![1.0; n], |start| start.gain.clone());
        let mut deviation =
            start.map_or_else(|| vec![0.0; n], |start| start.gain_deviation.clone());
        let of_fit = torque_scale::gains(&found.actives, n);
        for &(joint, of_gain) in fitted {
            (gain[joint], deviation[joint]) = (of_fit[joint], of_gain);
        }
        (gain, deviation)
    }

    /// Converts an effect to the format of `twin.yaml`. An effect that changes steadily cannot be extrapolated, so it
    /// becomes the simpler one with its value at the end of the recordings.
    fn spec(&self, active: &Active) -> TermSpec {
        let model = &self.input.model;
        let place = active.hypothesis.place;
        let site = Site {
            model,
            joint: place.joint,
            source: place.source,
            link: place.link,
        };
        TermSpec::of(&*active.term(model), &site).at_session(self.session_end_s())
    }

    /// Returns the end of the last recording \[s from the start of the session\].
    fn session_end_s(&self) -> f64 {
        let recordings = self.input.fit.iter().chain(&self.input.holdout);
        let ends = recordings.map(|recording| {
            let start_ns = recording.start_ns - self.session_start_ns;
            start_ns as f64 * 1e-9 + recording.time_s.last().copied().unwrap_or(0.0)
        });
        ends.fold(0.0, f64::max)
    }

    /// Returns the bodies of an explanation that load the gears for more than a moment.
    pub fn bodies(&self, found: &Fit) -> Vec<TermSpec> {
        let of_bodies = |active: &&Active| {
            let hypothesis = active.hypothesis;
            let lasts = !matches!(hypothesis.time_kind(), TimeKind::Once);
            hypothesis.effect.layer == Layer::Body && !hypothesis.is_torque_scale() && lasts
        };
        let bodies = found.actives.iter().filter(of_bodies);
        bodies.map(|active| self.spec(active)).collect()
    }

    /// Returns the terms of the corrected twin: all but temporary effects, curves over time, and those of the joints
    /// in `kept`, which keep the initial twin.
    pub fn lasting_terms(&self, found: &Fit, kept: &[usize]) -> Vec<TermSpec> {
        let mut terms = self
            .input
            .start
            .as_ref()
            .map_or_else(Vec::new, |start| start.terms.clone());
        for active in &found.actives {
            let is_withheld =
                (active.hypothesis.only_joint()).is_some_and(|joint| kept.contains(&joint));
            let is_kept = active.hypothesis.effect.traits.in_session
                && self.spec(active).effect != active.hypothesis.effect.name;
            let lasts = is_kept || active.hypothesis.lasts() && !active.is_curve_over_time();
            if active.hypothesis.is_torque_scale() || !lasts || is_withheld {
                continue;
            }
            let term = self.spec(active);
            // With torque constants the terms of a twin are in N m, otherwise in the recorded unit.
            let term = if self.input.torque_constants_nm_per_a.is_none() {
                friction::in_recorded_units(&term, &self.input.model, self.unit_nm)
            } else {
                term
            };
            friction::add(term, &mut terms);
        }
        terms
    }
}
