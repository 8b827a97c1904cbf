//! Means of the residual over windows that end at the newest sample.

use tauscope_bus::{JointArray, MAX_JOINTS, TwinState};

use super::learnt::LearntJoint;
use super::spans::{Follow, LONG, MIDDLE, SHORTEST, WINDOWS_S};
use super::sums::Sums;
use super::usual::{FEATURES, Step, Usual};

/// Largest deviation of a window's mean from that of the next shorter window, in units of the shorter window's noise.
/// It keeps a long window from reporting a contact that is over.
/// Statistical: two standard deviations hold 95 % of Gaussian noise.
const BORNE_OUT: f64 = 2.0;
/// Time in which the recent lowest speed of a joint recovers to its reference speed \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const SLOW_MEMORY_S: f64 = 0.3;
/// Time constant with which the zero of a stationary arm follows creep after a contact, and with which it decays once
/// the arm moves \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const SETTLES_S: f64 = 0.3;

/// Limits the mean over each window to within [`BORNE_OUT`] times the noise around the mean over the next shorter
/// window. `noise` is by window and joint.
pub(super) fn borne_out(
    means: &[JointArray; WINDOWS_S.len()],
    windows: usize,
    joints: usize,
    noise: impl Fn(usize, usize) -> f64,
) -> [JointArray; WINDOWS_S.len()] {
    let mut borne_out = *means;
    for w in 1..windows {
        for j in 0..joints {
            let newer = borne_out[w - 1][j];
            let margin = BORNE_OUT * noise(w - 1, j);
            borne_out[w][j] = means[w][j].max(newer - margin).min(newer + margin);
        }
    }
    borne_out
}

/// Returns the value that is closer to 0; the first if the second is NaN (unknown).
fn smaller(a: f64, b: f64) -> f64 {
    if b.abs() < a.abs() { b } else { a }
}

/// Running means of the residual over each window.
#[derive(Debug)]
pub(crate) struct Means {
    sums: Sums,
    /// Baseline of the residual, by joint.
    usual: Vec<Usual>,
    /// Mean residual over each step, with the lag of the twin corrected by the change of velocity; and (`newest`) the
    /// residual before this correction at the end of the newest step.
    known: Sums,
    newest: JointArray,
    /// Residual of the newest sample after the baseline, from which the baseline adapts; `None` while the offset is
    /// learnt.
    left: Option<JointArray>,
    /// By window and joint, the mean of `sums` or of `known`, whichever is closer to 0.
    nearer: [JointArray; WINDOWS_S.len()],
    /// Residual with which the arm came to rest after a contact.
    settled: JointArray,
    settings: Follow,
    /// Filter coefficients of the present time step, and the share of the drift that is followed in it. They are
    /// cached, because sample clocks are often uniform.
    step: (Step, f64),
    /// Lowest recent speed by joint \[rad/s\].
    pub slow: JointArray,
    fast: JointArray,
    start_ns: i64,
}

impl Means {
    /// Creates the means for these joints over the first `windows` windows.
    pub fn new(joints: &[LearntJoint], settings: Follow, windows: usize) -> Self {
        let mut fast = [0.0; MAX_JOINTS];
        for (fast, joint) in fast.iter_mut().zip(joints) {
            *fast = joint.fast_rad_s;
        }
        let usual = |joint: &LearntJoint| Usual::new(joint.fast_rad_s, joint.usual.as_ref());
        Self {
            sums: Sums::new(windows),
            usual: joints.iter().map(usual).collect(),
            known: Sums::new(windows),
            newest: [0.0; MAX_JOINTS],
            left: None,
            nearer: [[0.0; MAX_JOINTS]; WINDOWS_S.len()],
            settled: [0.0; MAX_JOINTS],
            settings,
            step: (Step::of(0.0), 0.0),
            slow: [0.0; MAX_JOINTS],
            fast,
            start_ns: 0,
        }
    }

    pub fn reset(&mut self) {
        self.sums.reset();
        self.known.reset();
        self.usual.iter_mut().for_each(Usual::reset);
        self.settled = [0.0; MAX_JOINTS];
    }

    /// Returns whether the windows up to [`LONG`] are full and the offset is known. Until the last window is full, it
    /// serves as a shorter one.
    pub fn ready(&self) -> bool {
        let newest = self.sums.newest_ns();
        let longest = WINDOWS_S[LONG];
        (newest - self.start_ns) as f64 * 1e-9 >= longest.max(self.settings.offset_from_first_s)
    }

    /// Takes a sample with the inertial effort that the twin lacks in it.
    pub fn push(&mut self, sample: &TwinState, late: &JointArray) {
        let n = self.usual.len();
        let now = sample.header.stamp_ns;
        let is_first = self.sums.is_empty();
        if is_first {
            self.start_ns = now;
            self.slow = sample.velocity.map(f64::abs);
        }
        let dt_s = if is_first {
            0.0
        } else {
            (now - self.sums.newest_ns()) as f64 * 1e-9
        };
        let since_s = (now - self.start_ns) as f64 * 1e-9;
        let first = since_s < self.settings.offset_from_first_s;
        if !self.step.0.lasts(dt_s) {
            let drift = 1.0 - (-dt_s / self.settings.drift_s).exp();
            self.step = (Step::of(dt_s), drift);
        }
        let step = &self.step.0;
        let recovery = dt_s / SLOW_MEMORY_S;
        let (mut row, mut step_end) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        let mut beside = [0.0; MAX_JOINTS];
        for (j, (value, usual)) in row.iter_mut().zip(&mut self.usual).enumerate() {
            let efforts = [sample.effort[j], sample.expected_effort[j]];
            let left = efforts[0] - efforts[1] - usual.next(step, sample.velocity[j], efforts);
            let offset = if first {
                // Recursive mean over the first seconds.
                usual.offset(left, dt_s / (since_s + dt_s).max(1e-9))
            } else {
                0.0
            };
            beside[j] = left;
            *value = left - offset - self.settled[j];
            step_end[j] = *value + usual.late();
            let recovered = self.slow[j] + recovery * self.fast[j];
            self.slow[j] = recovered.min(sample.velocity[j].abs());
        }
        self.left = (!first).then_some(beside);
        if is_first {
            self.newest = step_end;
        }
        let mut known = [0.0; MAX_JOINTS];
        for (j, known) in known.iter_mut().enumerate().take(n) {
            *known = 0.5 * (step_end[j] + self.newest[j]) - late[j];
        }
        self.newest = step_end;
        self.sums.push(now, &row, n);
        self.known.push(now, &known, n);
        self.explain();
    }

    /// Treats the newest sample's residual as slow drift, and adapts the baseline to it.
    pub fn follow(&mut self) {
        let Some(left) = self.left.take() else {
            return;
        };
        for (usual, left) in self.usual.iter_mut().zip(left) {
            usual.follow(left, self.step.1);
        }
    }

    /// Corrects the lag of the twin by the expected effort or by the change of velocity, whichever leaves less.
    /// Either may err, and a residual that one of them explains is no contact.
    fn explain(&mut self) {
        self.nearer = self.sums.means;
        for (means, known) in self.nearer.iter_mut().zip(&self.known.means) {
            for (mean, known) in means.iter_mut().zip(known) {
                *mean = smaller(*mean, *known);
            }
        }
    }

    /// Takes the present residual as the new zero of the arm, which has come to rest.
    pub fn settle(&mut self) {
        let left = self.nearer[MIDDLE];
        for (settled, left) in self.settled.iter_mut().zip(&left) {
            *settled += left;
        }
        self.sums.shift(&left, self.usual.len());
        self.known.shift(&left, self.usual.len());
        self.explain();
    }

    /// Lets the zero of the arm at rest follow creep, or decay if it `moves`.
    pub fn creep(&mut self, moves: bool) {
        let dt_s = self.step.0.dt_s();
        let share = dt_s / (SETTLES_S + dt_s);
        for (settled, left) in self.settled.iter_mut().zip(&self.nearer[MIDDLE]) {
            *settled += share * if moves { -*settled } else { *left };
        }
    }

    /// Returns the mean residual of a joint over a window \[effort unit\].
    pub fn mean(&self, window: usize, joint: usize) -> f64 {
        self.nearer[window][joint]
    }

    /// Returns this mean without the correction by the change of velocity.
    pub fn whole(&self, window: usize, joint: usize) -> f64 {
        self.sums.means[window][joint]
    }

    /// Returns, by joint, the present weights of the baseline's features.
    pub fn usual_weights(&self) -> impl Iterator<Item = [f64; FEATURES]> + '_ {
        self.usual.iter().map(Usual::weights)
    }

    /// Returns the uncertainty of a joint's baseline \[effort unit\].
    pub fn doubt(&self, joint: usize) -> f64 {
        self.usual[joint].doubt()
    }

    /// Returns the factor on a joint's noise for a motion that differs from the training motion.
    pub fn strange(&self, joint: usize) -> f64 {
        self.usual[joint].strange().sqrt()
    }

    /// Returns the unrest of a joint: the recent change that both efforts have in common \[effort unit\].
    pub fn unrest(&self, joint: usize) -> f64 {
        self.usual[joint].unrest()
    }

    /// Returns the means by window and joint.
    pub fn all(&self) -> &[JointArray; WINDOWS_S.len()] {
        &self.nearer
    }

    /// Returns the stamp of the newest sample.
    pub fn newest_ns(&self) -> i64 {
        self.sums.newest_ns()
    }

    /// Returns the mean of the shortest window that ended at this instant.
    pub fn earlier(&self, to_ns: i64) -> JointArray {
        // The window excludes its start.
        let from_ns = to_ns - (WINDOWS_S[SHORTEST] * 1e9) as i64 + 1;
        let mut mean = self.sums.rows.mean(from_ns, to_ns);
        let known = self.known.rows.mean(from_ns, to_ns);
        for (mean, known) in mean.iter_mut().zip(&known) {
            *mean = smaller(*mean, *known);
        }
        mean
    }
}
