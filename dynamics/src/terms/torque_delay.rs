//! Effort that is reported late.

use super::law::array;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Scale, Simulated, Site, Term, Traits, Words,
};

/// How many samples are remembered: enough for a second at 1 kHz.
/// Tuned: from the longest delay and the usual rates; not swept.
const CAPACITY: usize = 1024;

/// Recorded effort: the true one as it was a while ago, straight between samples, the same for all
/// joints. Before that the first sample is held.
pub(super) static EFFECT: Effect = Effect {
    name: "torque_delay",
    words: Words::new(
        "Torque delay",
        "torque delay",
        "The torque is reported late against the position.",
        "The recorder and the controller's clock: effort and position have not the same time.",
        "The effort is recorded {delay_s} late.",
    ),
    family: Family::Recording,
    place: PlaceKind::All,
    layer: Layer::Record,
    parameters: &[Parameter::at_least("delay_s", 0.0)],
    coordinates: &[Coordinate::shape("delay_s", 0.002, 1.0, 12, Scale::Log)],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    limit: None,
    excitation: Excitation::Fast,
    simulated: Simulated::Record,
    concealed: Some(|_| Drawn::new([1e-3, 0.2], |delay| vec![("delay_s", delay)])),
    traits: Traits::NONE,
    build: |site, values| Box::new(TorqueDelay::new(site, array(values))),
};

#[derive(Debug)]
struct TorqueDelay {
    values: [f64; 1],
    joint_count: usize,
    /// Time since the reset \[s\].
    now_s: f64,
    /// A ring of times and, joint by joint, of efforts.
    times_s: Vec<f64>,
    efforts: Vec<f64>,
    /// How many were stored since the reset.
    stored: usize,
    /// The oldest that may still be asked for; it only moves on.
    oldest: usize,
}

impl TorqueDelay {
    fn new(site: &Site<'_>, values: [f64; 1]) -> Self {
        let joint_count = site.model.dof();
        Self {
            values,
            joint_count,
            now_s: 0.0,
            times_s: vec![0.0; CAPACITY],
            efforts: vec![0.0; CAPACITY * joint_count],
            stored: 0,
            oldest: 0,
        }
    }

    fn time_s(&self, index: usize) -> f64 {
        self.times_s[index % CAPACITY]
    }

    fn store(&mut self, effort: &[f64]) {
        // More than fits into the ring within the delay is not stored: what was in between is taken
        // from the straight line. Of three samples the first and last are at least so far apart.
        let finest_s = 2.0 * self.values[0] / (CAPACITY - 4) as f64;
        let index = match self.stored {
            // The newest is always kept; it gives way to the next if it came too soon.
            n if n >= 2 && self.now_s - self.time_s(n - 2) < finest_s => n - 1,
            n => {
                self.stored += 1;
                n
            }
        };
        let at = index % CAPACITY;
        self.times_s[at] = self.now_s;
        self.efforts[at * self.joint_count..][..self.joint_count].copy_from_slice(effort);
    }
}

impl Term for TorqueDelay {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn reset(&mut self) {
        self.now_s = 0.0;
        self.stored = 0;
        self.oldest = 0;
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        self.now_s += at.dt_s.max(0.0);
        self.store(effort);
        let wanted_s = self.now_s - self.values[0].max(0.0);
        self.oldest = self.oldest.max((self.stored).saturating_sub(CAPACITY));
        while self.oldest + 2 < self.stored && self.time_s(self.oldest + 1) <= wanted_s {
            self.oldest += 1;
        }
        let (before, after) = (self.oldest, (self.oldest + 1).min(self.stored - 1));
        let (t0, t1) = (self.time_s(before), self.time_s(after));
        let share = if t1 > t0 {
            ((wanted_s - t0) / (t1 - t0)).clamp(0.0, 1.0)
        } else {
            1.0
        };
        let n = self.joint_count;
        let (before, after) = ((before % CAPACITY) * n, (after % CAPACITY) * n);
        for (j, effort) in effort.iter_mut().enumerate() {
            let (e0, e1) = (self.efforts[before + j], self.efforts[after + j]);
            *effort = e0 + (e1 - e0) * share;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    /// Largest error of a delayed straight line, which interpolation cannot miss.
    fn error(delay_s: f64, dt_s: f64, samples: u32) -> f64 {
        let robot = TwoJoints::new();
        let mut term = (EFFECT.build)(&robot.site(), &[delay_s]);
        let mut worst = 0.0_f64;
        for pass in 0..2 {
            term.reset();
            for k in 0..samples {
                let t = dt_s * f64::from(k);
                let mut effort = [3.0 + t, 3.0 - t];
                let at = sample(
                    if k > 0 { dt_s } else { 0.0 },
                    t,
                    [0.0; 2],
                    [0.0; 2],
                    [0.0; 2],
                );
                term.act(&at.view(), &mut effort);
                let then = (t - delay_s).max(0.0);
                let wrong = (effort[0] - 3.0 - then)
                    .abs()
                    .max((effort[1] - 3.0 + then).abs());
                assert!(wrong < 1e-9, "pass {pass}, {t}: {effort:?}, {then}");
                worst = worst.max(wrong);
            }
        }
        worst
    }

    #[test]
    fn a_straight_line_comes_later_at_any_rate() {
        for (delay_s, dt_s) in [
            (0.037, 0.01),
            (0.003, 0.01),
            (0.0, 0.01),
            (1.0, 0.0004),
            (2.5, 0.001),
        ] {
            let samples = (2.0 * delay_s / dt_s) as u32 + 20;
            assert!(error(delay_s, dt_s, samples) < 1e-9);
        }
    }
}
