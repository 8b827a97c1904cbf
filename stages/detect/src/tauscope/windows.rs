//! Scores of the mean residual over windows that end at the newest sample.

use tauscope_bus::{JointArray, MAX_JOINTS, TwinState};

use super::learnt::{Learnt, bin};
use super::means::{Means, borne_out};
use super::recovery::{FADES_S, Recovery};
use super::rest::Rest;
use super::spans::{Follow, LONG, MIDDLE, SHORTEST, WINDOWS_S};
use super::stand::{End, Stand};

/// Highest speed at which a stationary arm yields to a push \[rad/s, m/s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const SLOW: f64 = 0.1;
/// Amplitude of the creep after a contact with a stationary arm, as a share of the contact.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const CREEPS: f64 = 0.1;

/// Change of the residual against the present contact, as inner products in the Mahalanobis metric.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Change {
    /// Product of the change with itself.
    pub size: f64,
    /// Product of the change with the contact as it has been followed.
    pub along: f64,
    /// Product of that contact with itself.
    pub held: f64,
}

/// A contact with a stationary arm that is over: its end, and the root of its score.
#[derive(Debug, Clone, Copy)]
struct Settled {
    at_ns: i64,
    size: f64,
}

/// Whitened means of the residual.
#[derive(Debug)]
pub(crate) struct Windows {
    means: Means,
    learnt: Learnt,
    /// Detection of contacts with a stationary arm; `None` if it is not used.
    at_rest: Option<Rest>,
    stand: Stand,
    /// Present contact with a stationary arm, and the last one that ended.
    end: End,
    settled: Option<Settled>,
    /// Residual that static friction may hold after a contact; `None` if it is not considered.
    recovery: Option<Recovery>,
    /// By joint, the factor on the noise because of this friction.
    doubt: JointArray,
    /// By window and joint, the noise at the present speed and unrest \[effort unit\].
    noise: [JointArray; WINDOWS_S.len()],
    /// By window and joint, the mean residual, limited by that of the next shorter window \[effort unit\].
    borne_out: [JointArray; WINDOWS_S.len()],
    /// Mean residual of the present contact, as it is followed, and the mean residual from before it began.
    held: JointArray,
    base: JointArray,
    /// Mean residual when the score was last too low for a contact.
    rest: JointArray,
    /// Newest score.
    score: f64,
}

impl Windows {
    pub fn new(learnt: &Learnt, settings: Follow) -> Self {
        Self {
            means: Means::new(&learnt.joints, settings, learnt.windows.len()),
            learnt: learnt.clone(),
            at_rest: None,
            stand: Stand::new(SLOW),
            end: End::default(),
            settled: None,
            recovery: None,
            doubt: [1.0; MAX_JOINTS],
            noise: [[0.0; MAX_JOINTS]; WINDOWS_S.len()],
            borne_out: [[0.0; MAX_JOINTS]; WINDOWS_S.len()],
            held: [0.0; MAX_JOINTS],
            base: [0.0; MAX_JOINTS],
            rest: [0.0; MAX_JOINTS],
            score: 0.0,
        }
    }

    /// Starts the search for contacts at this `threshold`, chosen for `per_hour` false alarms an hour. If standstill
    /// was learnt, the effort of a stationary arm is compared with that from before the contact. Residual that static
    /// friction may hold after a contact counts as noise.
    pub fn seek(&mut self, threshold: f64, per_hour: f64) {
        let rest = self.learnt.rest.as_ref();
        self.at_rest =
            rest.map(|rest| Rest::new(rest, self.learnt.joints.len(), threshold, per_hour));
        self.recovery = Some(Recovery::default());
    }

    /// Sets another threshold.
    pub fn retune(&mut self, threshold: f64) {
        if let Some(rest) = &mut self.at_rest {
            rest.retune(threshold);
        }
    }

    /// Returns the learnt state with the present weights of the baseline.
    pub fn learnt(&self) -> Learnt {
        let mut learnt = self.learnt.clone();
        for (joint, weights) in learnt.joints.iter_mut().zip(self.means.usual_weights()) {
            if let Some(usual) = &mut joint.usual {
                usual.go_on(weights);
            }
        }
        learnt
    }

    pub fn reset(&mut self) {
        self.means.reset();
        if let Some(rest) = &mut self.at_rest {
            rest.reset();
        }
        self.stand.reset();
        self.end.forget();
        self.settled = None;
        if let Some(recovery) = &mut self.recovery {
            recovery.reset();
        }
        self.doubt = [1.0; MAX_JOINTS];
        self.score = 0.0;
    }

    pub fn ready(&self) -> bool {
        self.means.ready()
    }

    /// Returns the score of the next sample: the largest of the windows' scores and the score at standstill. `late`
    /// is the inertial effort that the twin lacks in this sample. Drift is followed where the score is below `usual`.
    pub fn score(&mut self, sample: &TwinState, late: &JointArray, usual: Option<f64>) -> f64 {
        self.means.push(sample, late);
        for (j, joint) in self.learnt.joints.iter().enumerate() {
            let bin = bin(joint, self.means.slow[j]);
            let (unrest, strange) = (self.means.unrest(j), self.means.strange(j));
            for (noise, window) in self.noise.iter_mut().zip(&self.learnt.windows) {
                let usual = window.noise[j][bin] * strange;
                noise[j] = usual.hypot(window.unquiet[j] * unrest);
            }
        }
        let now_ns = sample.header.stamp_ns;
        self.doubt = [1.0; MAX_JOINTS];
        self.score = self.most_unusual();
        if let Some(recovery) = &mut self.recovery {
            recovery.step(now_ns, self.score.sqrt(), usual.is_none());
            if recovery.doubts() {
                for (doubt, slow) in self.doubt.iter_mut().zip(&self.means.slow) {
                    *doubt = recovery.doubt(*slow);
                }
                self.score = self.most_unusual();
            }
        }
        self.score /= self.creep(now_ns);
        let at_rest = (self.at_rest.as_mut()).and_then(|rest| rest.score(sample, usual.is_some()));
        self.score = at_rest.map_or(self.score, |score| score.max(self.score));
        // An outlier, however short, is no drift: the baseline would keep one bad reading for minutes.
        if usual.is_some_and(|usual| self.score < usual) {
            self.means.follow();
        }
        self.score
    }

    /// Returns the largest of the windows' scores.
    fn most_unusual(&mut self) -> f64 {
        let windows = self.learnt.windows.len();
        self.borne_out = borne_out(self.means.all(), windows, self.joints(), |w, j| {
            self.doubted(w, j)
        });
        let scores = (0..windows).map(|w| self.length(w) / self.learnt.windows[w].usual);
        scores.fold(0.0, f64::max)
    }

    /// Returns the divisor of the score that allows for creep after a contact with a stationary arm.
    fn creep(&self, now_ns: i64) -> f64 {
        self.settled.map_or(1.0, |over| {
            let fades = (-((now_ns - over.at_ns) as f64 * 1e-9) / FADES_S).exp();
            (1.0 + CREEPS * over.size * fades).powi(2)
        })
    }

    /// Detects the end of a contact with a stationary arm, takes the remaining residual as the new zero and returns
    /// whether a contact has ended. To be called with each judged sample, `free` of contacts or not.
    pub fn settle(&mut self, sample: &TwinState, free: bool) -> bool {
        let now_ns = sample.header.stamp_ns;
        if !self.stand.step(sample, self.joints()) {
            self.end.forget();
            if self.settled.is_some() {
                self.means.creep(true);
            }
            return false;
        }
        if free {
            self.end.forget();
            // The creep is followed for one time constant.
            let creeps = |over: Settled| ((now_ns - over.at_ns) as f64 * 1e-9) < FADES_S;
            if self.settled.is_some_and(creeps) {
                self.means.creep(false);
            }
            return false;
        }
        let (mut units, mut changed) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for j in 0..self.joints() {
            let noise = self.noise(MIDDLE, j);
            units[j] = (self.means.whole(MIDDLE, j) - self.base[j]) / noise;
            changed[j] = (self.mean(MIDDLE, j) - self.mean(LONG, j)) / noise;
        }
        if !self.end.step(now_ns, &units, &changed) {
            return false;
        }
        let size = (self.end.whole() / self.learnt.windows[MIDDLE].usual).sqrt();
        self.end.forget();
        self.means.settle();
        if let Some(rest) = &mut self.at_rest {
            rest.settle();
        }
        self.settled = Some(Settled {
            at_ns: now_ns,
            size,
        });
        true
    }

    /// Returns the newest score.
    pub fn newest_score(&self) -> f64 {
        self.score
    }

    /// Returns the longest window without samples from before this instant, or else the shortest one.
    pub fn since(&self, instant_ns: i64) -> usize {
        let s = (self.means.newest_ns() - instant_ns) as f64 * 1e-9;
        let windows = &WINDOWS_S[..self.learnt.windows.len()];
        windows
            .iter()
            .rposition(|length_s| *length_s <= s)
            .unwrap_or(SHORTEST)
    }

    /// Returns the squared Mahalanobis length of the mean residual over a window, limited by the next shorter window.
    pub fn length(&self, window: usize) -> f64 {
        self.length_of(window, |joint| self.borne_out[window][joint])
    }

    fn length_of(&self, window: usize, mean: impl Fn(usize) -> f64) -> f64 {
        let n = self.learnt.joints.len();
        let mut z = [0.0; MAX_JOINTS];
        for (j, z) in z.iter_mut().enumerate().take(n) {
            *z = mean(j) / self.doubted(window, j);
        }
        let inverse = &self.learnt.windows[window].inverse_correlation;
        // The matrix is symmetric: a row is a column.
        let mut products = [0.0; MAX_JOINTS];
        for (column, z) in inverse.chunks_exact(n).zip(&z) {
            for (product, entry) in products.iter_mut().zip(column) {
                *product += entry * z;
            }
        }
        (0..n).map(|a| z[a] * products[a]).sum()
    }

    /// Returns the mean residual of a joint over a window \[effort unit\].
    pub fn mean(&self, window: usize, joint: usize) -> f64 {
        self.means.mean(window, joint)
    }

    /// Returns the mean residual of a joint over a window less its value before the present contact began \[effort
    /// unit\]. For a contact on top of another, this value includes the other contact.
    pub fn excess(&self, window: usize, joint: usize) -> f64 {
        self.mean(window, joint) - self.base[joint]
    }

    /// Takes the present mean residual as that without a contact.
    pub fn rest(&mut self) {
        self.rest = std::array::from_fn(|j| self.mean(LONG, j));
    }

    /// Returns the change of the mean residual over the shortest window since this instant \[effort unit\].
    pub fn rise(&self, since_ns: i64) -> JointArray {
        let mut rise = self.means.earlier(since_ns);
        for (j, rise) in rise.iter_mut().enumerate().take(self.joints()) {
            *rise = self.mean(SHORTEST, j) - *rise;
        }
        rise
    }

    /// Starts to follow a contact, alone or on top of the present one.
    pub fn begin(&mut self, on_top: bool) {
        self.base = if on_top { self.held } else { self.rest };
        self.held = std::array::from_fn(|j| self.mean(MIDDLE, j));
    }

    /// Follows the present contact by this share of its change.
    pub fn hold(&mut self, share: f64) {
        for j in 0..self.joints() {
            self.held[j] += share * (self.mean(MIDDLE, j) - self.held[j]);
        }
    }

    /// Returns whether the residual is larger than the contact as it has been followed.
    pub fn grows(&self) -> bool {
        self.length(MIDDLE) / self.learnt.windows[MIDDLE].usual >= self.held()
    }

    /// Returns the score of the contact as it has been followed.
    pub fn held(&self) -> f64 {
        self.length_of(MIDDLE, |joint| self.held[joint]) / self.learnt.windows[MIDDLE].usual
    }

    /// Returns the size of the residual's change against the contact as it has been followed, and its direction
    /// relative to that contact.
    pub fn change(&self) -> Change {
        let n = self.joints();
        let (mut change, mut held) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for j in 0..n {
            let noise = self.doubted(MIDDLE, j);
            change[j] = (self.mean(MIDDLE, j) - self.held[j]) / noise;
            held[j] = self.held[j] / noise;
        }
        let inverse = &self.learnt.windows[MIDDLE].inverse_correlation;
        let product = |a: &JointArray, b: &JointArray| -> f64 {
            let rows = inverse.chunks_exact(n).zip(a);
            rows.map(|(row, a)| a * row.iter().zip(b).map(|(entry, b)| entry * b).sum::<f64>())
                .sum()
        };
        let usual = self.learnt.windows[MIDDLE].usual;
        Change {
            size: product(&change, &change) / usual,
            along: product(&change, &held) / usual,
            held: product(&held, &held) / usual,
        }
    }

    /// Returns the noise at the joint's present speed and unrest \[effort unit\].
    pub fn noise(&self, window: usize, joint: usize) -> f64 {
        self.noise[window][joint]
    }

    /// Returns the noise including the residual that static friction may hold after a contact. It serves to detect
    /// contacts; locating them and finding their end at standstill use [`Windows::noise`].
    fn doubted(&self, window: usize, joint: usize) -> f64 {
        self.noise[window][joint] * self.doubt[joint]
    }

    /// Returns the inverse of the correlation of the joints' means over a window, row by row.
    pub fn inverse_correlation(&self, window: usize) -> &[f64] {
        &self.learnt.windows[window].inverse_correlation
    }

    /// Returns the number of joints.
    pub fn joints(&self) -> usize {
        self.learnt.joints.len()
    }
}
