//! Means of the residual over windows that end at the newest sample.

use tauscope_bus::{JointArray, MAX_JOINTS, TwinState};

use super::learnt::LearntJoint;
use super::spans::{Follow, LONG, MIDDLE, SHORTEST, WINDOWS_S};
use super::sums::Sums;
use super::usual::{FEATURES, Step, Usual};

/// So much of the usual noise of the next shorter window's mean a longer one's may be away from it: what has gone is not told any longer.
/// Statistical: two standard deviations hold 95 % of Gaussian noise.
const BORNE_OUT: f64 = 2.0;
/// How long a joint that was slow counts as slow \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const SLOW_MEMORY_S: f64 = 0.3;
/// Time constant with which creep of a standing arm is followed behind a contact, and where it stood is forgotten once it moves \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const SETTLES_S: f64 = 0.3;

/// Means over the windows as far as those over the next shorter ones bear them out, with these `noise`s by window and joint.
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

/// Whichever is closer to 0; the first where the second is not known.
fn smaller(a: f64, b: f64) -> f64 {
    if b.abs() < a.abs() { b } else { a }
}

/// Running means of the residual over each window.
#[derive(Debug)]
pub(crate) struct Means {
    sums: Sums,
    /// The residual that is usual just now, by joint.
    usual: Vec<Usual>,
    /// What is left of the residual over each step when its change of velocity tells what the twin misses; and at the end of the newest step.
    known: Sums,
    newest: JointArray,
    /// What the newest sample left of the residual beside what is usual, to be followed; nothing where its offset is being learnt.
    left: Option<JointArray>,
    /// By window and joint, the mean of whichever of both is closer to 0.
    nearer: [JointArray; WINDOWS_S.len()],
    /// What is left of the residual where the arm has come to rest behind a contact.
    settled: JointArray,
    settings: Follow,
    /// Step \[s\], and how much of the residual's drift is followed in it; kept, for clocks are often even.
    step: (Step, f64),
    /// Smallest speed of late, by joint.
    pub slow: JointArray,
    fast: JointArray,
    start_ns: i64,
}

impl Means {
    /// For these joints, over the first so many `windows`.
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

    /// Whether the windows are full (the last one is as good as the one before it until then), and the offset known.
    pub fn ready(&self) -> bool {
        let newest = self.sums.newest_ns();
        let longest = WINDOWS_S[LONG];
        (newest - self.start_ns) as f64 * 1e-9 >= longest.max(self.settings.offset_from_first_s)
    }

    /// Takes a sample with what the twin misses of it.
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
                // The mean of the first seconds, as it grows.
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

    /// Takes what the newest sample left of the residual for slow drift, and follows it.
    pub fn follow(&mut self) {
        let Some(left) = self.left.take() else {
            return;
        };
        for (usual, left) in self.usual.iter_mut().zip(left) {
            usual.follow(left, self.step.1);
        }
    }

    /// How late the twin is can be told from the expected effort or from the change of velocity: either errs, and what one of them explains is no contact.
    fn explain(&mut self) {
        self.nearer = self.sums.means;
        for (means, known) in self.nearer.iter_mut().zip(&self.known.means) {
            for (mean, known) in means.iter_mut().zip(known) {
                *mean = smaller(*mean, *known);
            }
        }
    }

    /// The arm has come to rest with the residual as it is.
    pub fn settle(&mut self) {
        let left = self.nearer[MIDDLE];
        for (settled, left) in self.settled.iter_mut().zip(&left) {
            *settled += left;
        }
        self.sums.shift(&left, self.usual.len());
        self.known.shift(&left, self.usual.len());
        self.explain();
    }

    /// Where the arm has come to rest creeps, or is forgotten if it `moves`.
    pub fn creep(&mut self, moves: bool) {
        let dt_s = self.step.0.dt_s();
        let share = dt_s / (SETTLES_S + dt_s);
        for (settled, left) in self.settled.iter_mut().zip(&self.nearer[MIDDLE]) {
            *settled += share * if moves { -*settled } else { *left };
        }
    }

    /// Mean residual of a joint over a window \[effort unit\].
    pub fn mean(&self, window: usize, joint: usize) -> f64 {
        self.nearer[window][joint]
    }

    /// The same, whatever the change of velocity tells.
    pub fn whole(&self, window: usize, joint: usize) -> f64 {
        self.sums.means[window][joint]
    }

    /// By joint, what each feature of what is usual weighs now.
    pub fn usual_weights(&self) -> impl Iterator<Item = [f64; FEATURES]> + '_ {
        self.usual.iter().map(Usual::weights)
    }

    /// How far the usual residual of a joint may be wrong \[effort unit\].
    pub fn doubt(&self, joint: usize) -> f64 {
        self.usual[joint].doubt()
    }

    /// How much larger the noise of a joint is than usual, for all that is known of such a motion.
    pub fn strange(&self, joint: usize) -> f64 {
        self.usual[joint].strange().sqrt()
    }

    /// How much both efforts of a joint have changed of late \[effort unit\].
    pub fn unrest(&self, joint: usize) -> f64 {
        self.usual[joint].unrest()
    }

    /// By window.
    pub fn all(&self) -> &[JointArray; WINDOWS_S.len()] {
        &self.nearer
    }

    /// Stamp of the newest sample.
    pub fn newest_ns(&self) -> i64 {
        self.sums.newest_ns()
    }

    /// What the shortest window's mean was at this instant.
    pub fn earlier(&self, to_ns: i64) -> JointArray {
        // The window is open where it begins.
        let from_ns = to_ns - (WINDOWS_S[SHORTEST] * 1e9) as i64 + 1;
        let mut mean = self.sums.rows.mean(from_ns, to_ns);
        let known = self.known.rows.mean(from_ns, to_ns);
        for (mean, known) in mean.iter_mut().zip(&known) {
            *mean = smaller(*mean, *known);
        }
        mean
    }
}
