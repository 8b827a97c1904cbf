//! How unusual the residual's means over windows that end at the newest sample are.

use tauscope_bus::{JointArray, MAX_JOINTS, TwinState};

use super::learnt::{Learnt, bin};
use super::means::{Means, borne_out};
use super::recovery::Recovery;
use super::rest::Rest;
use super::spans::{Follow, LONG, MIDDLE, SHORTEST, WINDOWS_S};
use super::stand::{End, Stand};

/// A standing arm that is pushed gives way no faster than this \[rad/s, m/s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const SLOW: f64 = 0.1;
/// What is left behind a contact with a standing arm creeps for so long \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const CREEPS_S: f64 = 1.5;
/// By so much of the contact.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const CREEPS: f64 = 0.1;

/// How the residual has changed against the contact that goes on: products in the metric of what is usual.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Change {
    /// Of the change with itself.
    pub size: f64,
    /// With the contact as it has been followed.
    pub along: f64,
    /// Of that with itself.
    pub held: f64,
}

/// A contact with a standing arm that is over: when, and the root of its score.
#[derive(Debug, Clone, Copy)]
struct Settled {
    at_ns: i64,
    size: f64,
}

/// Means of the residual, whitened.
#[derive(Debug)]
pub(crate) struct Windows {
    means: Means,
    learnt: Learnt,
    /// What is known of a standing arm, if it is heeded.
    at_rest: Option<Rest>,
    stand: Stand,
    /// The contact with a standing arm that goes on, and when one was over.
    end: End,
    settled: Option<Settled>,
    /// What friction may hold behind a contact, if it is heeded.
    recovery: Option<Recovery>,
    /// By joint, how many times larger that makes the noise now.
    doubt: JointArray,
    /// By window and joint, the noise at the present speed and unrest.
    noise: [JointArray; WINDOWS_S.len()],
    /// By window and joint, the mean residual as far as the newest samples bear it out.
    borne_out: [JointArray; WINDOWS_S.len()],
    /// Mean residual of the contact that goes on, as it is followed, and of the one below it.
    held: JointArray,
    base: JointArray,
    /// Mean residual when the score was usual last.
    rest: JointArray,
    /// How unusual: the newest score.
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

    /// From here on contacts are sought, at this `threshold` for so many false alarms an hour. A standing arm is held against what it was before
    /// it was touched, if that was learnt; and what friction may hold behind a contact is doubted.
    pub fn seek(&mut self, threshold: f64, per_hour: f64) {
        let rest = self.learnt.rest.as_ref();
        self.at_rest =
            rest.map(|rest| Rest::new(rest, self.learnt.joints.len(), threshold, per_hour));
        self.recovery = Some(Recovery::default());
    }

    /// From now on the threshold is another one.
    pub fn retune(&mut self, threshold: f64) {
        if let Some(rest) = &mut self.at_rest {
            rest.retune(threshold);
        }
    }

    /// What was learnt, with what has become usual since.
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

    /// The score of the next sample, of which the twin misses `late`: the most unusual window's, or that of a standing arm; below `usual`, drift is followed.
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
        // A sample that stands out is no drift, however short it is: one bad reading would be remembered for minutes.
        if usual.is_some_and(|usual| self.score < usual) {
            self.means.follow();
        }
        self.score
    }

    /// The score of the most unusual window.
    fn most_unusual(&mut self) -> f64 {
        let windows = self.learnt.windows.len();
        self.borne_out = borne_out(self.means.all(), windows, self.joints(), |w, j| {
            self.doubted(w, j)
        });
        let scores = (0..windows).map(|w| self.length(w) / self.learnt.windows[w].usual);
        scores.fold(0.0, f64::max)
    }

    /// By how much a score is less, for creep behind a contact with a standing arm.
    fn creep(&self, now_ns: i64) -> f64 {
        self.settled.map_or(1.0, |over| {
            let fades = (-((now_ns - over.at_ns) as f64 * 1e-9) / CREEPS_S).exp();
            (1.0 + CREEPS * over.size * fades).powi(2)
        })
    }

    /// Heeds where a standing arm comes to rest behind a contact: to be called with each sample that is judged, `free` of contacts or not. Whether a
    /// contact is over.
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
            let creeps = |over: Settled| ((now_ns - over.at_ns) as f64 * 1e-9) < CREEPS_S;
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

    /// The newest score.
    pub fn newest_score(&self) -> f64 {
        self.score
    }

    /// The longest window that holds nothing from before this instant, or the shortest.
    pub fn since(&self, instant_ns: i64) -> usize {
        let s = (self.means.newest_ns() - instant_ns) as f64 * 1e-9;
        let windows = &WINDOWS_S[..self.learnt.windows.len()];
        windows
            .iter()
            .rposition(|length_s| *length_s <= s)
            .unwrap_or(SHORTEST)
    }

    /// Squared Mahalanobis length of the mean residual over a window, as far as the newest samples bear it out.
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
        // Symmetric: a row is a column.
        let mut products = [0.0; MAX_JOINTS];
        for (column, z) in inverse.chunks_exact(n).zip(&z) {
            for (product, entry) in products.iter_mut().zip(column) {
                *product += entry * z;
            }
        }
        (0..n).map(|a| z[a] * products[a]).sum()
    }

    /// Mean residual of a joint over a window \[effort unit\].
    pub fn mean(&self, window: usize, joint: usize) -> f64 {
        self.means.mean(window, joint)
    }

    /// The same less what it was before the contact began, alone or on top of another.
    pub fn excess(&self, window: usize, joint: usize) -> f64 {
        self.mean(window, joint) - self.base[joint]
    }

    /// Takes the residual for what it is without a contact.
    pub fn rest(&mut self) {
        self.rest = std::array::from_fn(|j| self.mean(LONG, j));
    }

    /// How the mean residual over the shortest window has changed since this instant \[effort unit\].
    pub fn rise(&self, since_ns: i64) -> JointArray {
        let mut rise = self.means.earlier(since_ns);
        for (j, rise) in rise.iter_mut().enumerate().take(self.joints()) {
            *rise = self.mean(SHORTEST, j) - *rise;
        }
        rise
    }

    /// Begins to follow a contact, alone or on top of the one that goes on.
    pub fn begin(&mut self, on_top: bool) {
        self.base = if on_top { self.held } else { self.rest };
        self.held = std::array::from_fn(|j| self.mean(MIDDLE, j));
    }

    /// Follows the contact that goes on by a share of its changes.
    pub fn hold(&mut self, share: f64) {
        for j in 0..self.joints() {
            self.held[j] += share * (self.mean(MIDDLE, j) - self.held[j]);
        }
    }

    /// Whether the residual is larger than the contact as it has been followed.
    pub fn grows(&self) -> bool {
        self.length(MIDDLE) / self.learnt.windows[MIDDLE].usual >= self.held()
    }

    /// How unusual the contact is as it has been followed.
    pub fn held(&self) -> f64 {
        self.length_of(MIDDLE, |joint| self.held[joint]) / self.learnt.windows[MIDDLE].usual
    }

    /// How unusual the residual's change is against the contact as it has been followed, and how that lies to the contact.
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

    /// Its usual size at the joint's present speed and unrest \[effort unit\].
    pub fn noise(&self, window: usize, joint: usize) -> f64 {
        self.noise[window][joint]
    }

    /// The same where what friction may hold behind a contact is taken for noise, too. It says whether there is a contact; where one is and
    /// whether the arm has come to rest are no matter of it.
    fn doubted(&self, window: usize, joint: usize) -> f64 {
        self.noise[window][joint] * self.doubt[joint]
    }

    /// Inverse of the correlation of the joints' means over a window, row by row.
    pub fn inverse_correlation(&self, window: usize) -> &[f64] {
        &self.learnt.windows[window].inverse_correlation
    }

    /// How many joints there are.
    pub fn joints(&self) -> usize {
        self.learnt.joints.len()
    }
}
