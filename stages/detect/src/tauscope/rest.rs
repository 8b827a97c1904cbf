//! Score of a stationary arm: its effort compared with that from before the contact.
//!
//! Where an arm comes to rest, static friction may hold any effort up to its bound. The residual is therefore unknown
//! to within this bound, but it is constant. So while the arm is stationary, the *change* of the effort counts, in
//! units of its changes while nothing touches the arm; no twin is needed for this. An arm that is about to move
//! changes its effort, too. So a change counts once it has lasted for a while and the arm is still stationary.
//!
//! A contact leaves static friction in another state, which creeps for seconds. So a contact is over once the change
//! has lost most of its component along the contact, whatever else remains. The effort at that time is the new
//! reference. For a while, another contact must then exceed the creep that is to be expected after a contact of that
//! size.

use tauscope_bus::{JointArray, MAX_JOINTS, TwinState, flags};

use super::learnt::{ENOUGH_S, LearntRest};
use super::means::borne_out;
use super::pieces::{Piece, marked, quantile};
use super::recovery::FADES_S;
use super::spans::{LONG, MIDDLE, SHORTEST, WINDOWS_S};
use super::stand::{End, STILL_RAD_S, Stand};
use super::sums::Sums;
use super::tail::{Peaks, Tail};

/// Time for which a change must last to count: between this and twice as long \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const LASTS_S: f64 = 0.075;
/// Time constant with which the reference effort is followed while nothing touches the arm \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const FOLLOW_S: f64 = 1.0;
/// Amplitude of the creep after a contact, as a share of the contact.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const CREEPS: f64 = 0.5;
/// Minimum duration of standstill to learn from \[s\].
/// Chosen: ten times [`FOLLOW_S`], about ten independent changes. With less the noise is uncertain by more than a
/// fifth, with more, short recordings give no noise at rest.
const LEAST_S: f64 = 10.0;
/// Maximum number of samples to learn the noise from.
/// Resolution: the quantile of as many independent samples has a standard error of 0.7 %; changes the computing time.
const MOST_SAMPLES: usize = 20_000;
/// Quantile of the size of a joint's changes that is its noise: larger changes come from an arm that is about to
/// move.
/// Statistical: one standard deviation of Gaussian noise.
const WITHIN_NOISE: f64 = 0.683;
/// Quantile of the squared change over contact-free samples that is the unit of the score.
/// Statistical: one of a hundred contact-free samples exceeds it; at rest, samples are too few for a higher quantile.
const USUAL: f64 = 0.99;

/// Zero recent change for [`End::step`]: whether a contact is over does not depend on the change of what remains.
const STEADY: JointArray = [0.0; MAX_JOINTS];

/// Change of the mean effort by window and joint.
type Changes = [JointArray; WINDOWS_S.len()];

impl LearntRest {
    /// Returns the root of the largest squared length of the windows' changes, in units of [`LearntRest::usual`].
    fn size(&self, changes: &Changes) -> f64 {
        let joints = self.noise[SHORTEST].len();
        let changes = borne_out(changes, WINDOWS_S.len(), joints, |w, j| self.noise[w][j]);
        let lengths = changes.iter().zip(&self.noise).map(|(changes, noise)| {
            let units = changes.iter().zip(noise);
            units
                .map(|(change, noise)| (change / noise).powi(2))
                .sum::<f64>()
        });
        (lengths.fold(0.0, f64::max) / self.usual).sqrt()
    }
}

/// Recent minimum of a value.
#[derive(Debug)]
struct Lasting {
    begin_ns: i64,
    /// Smallest value since then (infinite if there is none), and in the interval before (0 if there is none).
    least: f64,
    before: f64,
}

impl Lasting {
    fn new(begin_ns: i64) -> Self {
        Self {
            begin_ns,
            least: f64::INFINITY,
            before: 0.0,
        }
    }

    fn step(&mut self, now_ns: i64, value: f64) -> f64 {
        if (now_ns - self.begin_ns) as f64 * 1e-9 >= LASTS_S {
            self.begin_ns = now_ns;
            self.before = std::mem::replace(&mut self.least, f64::INFINITY);
        }
        self.least = self.least.min(value);
        self.least.min(self.before)
    }
}

/// Reference effort of a stationary arm.
#[derive(Debug)]
struct Base {
    sums: Sums,
    stand: Stand,
    /// Reference effort; `None` while the arm moves or the reference is unknown.
    mean: Option<JointArray>,
    newest_ns: i64,
}

impl Base {
    fn new() -> Self {
        Self {
            sums: Sums::new(WINDOWS_S.len()),
            // An arm that is about to move changes its effort, too.
            stand: Stand::new(STILL_RAD_S),
            mean: None,
            newest_ns: 0,
        }
    }

    fn reset(&mut self) {
        self.sums.reset();
        self.stand.reset();
        self.mean = None;
    }

    /// Takes the next sample, and returns the change of the mean effort over each window from the reference. Returns
    /// `None` while the arm moves, or if it came to rest when it was not `free` of contacts.
    fn changes(&mut self, sample: &TwinState, joints: usize, free: bool) -> Option<Changes> {
        let now_ns = sample.header.stamp_ns;
        self.sums.push(now_ns, &sample.effort, joints);
        if !self.stand.step(sample, joints) {
            self.mean = None;
            return None;
        }
        if self.mean.is_none() {
            if !free {
                return None;
            }
            self.newest_ns = now_ns;
        }
        let mean = *self.mean.get_or_insert(self.sums.means[LONG]);
        let mut changes = self.sums.means;
        for window in &mut changes {
            for (change, mean) in window.iter_mut().zip(&mean) {
                *change -= mean;
            }
        }
        Some(changes)
    }

    /// Lets the reference follow the effort, which may creep, if `follows`.
    fn follow(&mut self, now_ns: i64, follows: bool) {
        let dt_s = (now_ns - std::mem::replace(&mut self.newest_ns, now_ns)) as f64 * 1e-9;
        let Some(mean) = self.mean.as_mut().filter(|_| follows) else {
            return;
        };
        let share = dt_s / (FOLLOW_S + dt_s);
        for (mean, newest) in mean.iter_mut().zip(&self.sums.means[LONG]) {
            *mean += share * (newest - *mean);
        }
    }
}

/// Calls `visit` with each change of a stationary arm that nothing touches, with its stamp and whether it is the
/// first since the arm came to rest.
fn each(all: &[Piece<'_>], joints: usize, mut visit: impl FnMut(i64, bool, &Changes)) {
    for piece in all {
        let mut base = Base::new();
        let mut is_first = true;
        for (sample, _, is_free) in marked(piece) {
            // The reference from before a contact is not valid after it.
            if sample.header.has(flags::RESET) || !is_free {
                base.reset();
            }
            let changes = base.changes(sample, joints, is_free);
            let now_ns = sample.header.stamp_ns;
            base.follow(now_ns, true);
            match changes {
                Some(changes) => visit(now_ns, std::mem::take(&mut is_first), &changes),
                None => is_first = true,
            }
        }
    }
}

/// Learns from contact-free samples, if the arm is stationary for long enough in them. `hold` shrinks the noise
/// towards the median.
pub(super) fn learn(
    joints: usize,
    all: &[Piece<'_>],
    hold: impl Fn(&mut [f64]),
) -> Option<LearntRest> {
    let (mut count, mut stood_ns, mut newest_ns) = (0, 0, 0);
    each(all, joints, |now_ns, is_first, _| {
        count += 1;
        let before_ns = std::mem::replace(&mut newest_ns, now_ns);
        stood_ns += if is_first { 0 } else { now_ns - before_ns };
    });
    let stood_s = stood_ns as f64 * 1e-9;
    if stood_s < LEAST_S {
        return None;
    }
    let every = count / MOST_SAMPLES + 1;
    let mut sizes = vec![vec![Vec::new(); joints]; WINDOWS_S.len()];
    let mut number = 0;
    each(all, joints, |_, _, changes| {
        number += 1;
        if number % every == 0 {
            for (sizes, changes) in sizes.iter_mut().zip(changes) {
                for (sizes, change) in sizes.iter_mut().zip(changes) {
                    sizes.push(change.abs());
                }
            }
        }
    });
    let noise = |sizes: &mut Vec<Vec<f64>>| {
        let of_joint = |sizes: &mut Vec<f64>| quantile(sizes, WITHIN_NOISE).max(1e-9);
        let mut noise: Vec<f64> = sizes.iter_mut().map(of_joint).collect();
        hold(&mut noise);
        noise
    };
    let mut learnt = LearntRest {
        noise: sizes.iter_mut().map(noise).collect(),
        usual: 1.0,
        tail: Tail::of_few(&[]),
    };
    let (mut peaks, mut scores) = (Peaks::default(), Vec::with_capacity(count));
    let mut lasting = Lasting::new(0);
    each(all, joints, |now_ns, is_first, changes| {
        if is_first {
            lasting = Lasting::new(now_ns);
        }
        let score = lasting.step(now_ns, learnt.size(changes)).powi(2);
        scores.push(score);
        peaks.add(now_ns, score);
    });
    learnt.usual = quantile(&mut scores, USUAL).max(1e-9);
    let blocks: Vec<f64> = (peaks.into_blocks().iter())
        .map(|peak| peak / learnt.usual)
        .collect();
    learnt.tail = if stood_s < ENOUGH_S {
        Tail::of_few(&blocks)
    } else {
        Tail::new(blocks)
    };
    Some(learnt)
}

/// Detection of contacts with a stationary arm.
#[derive(Debug)]
pub(super) struct Rest {
    learnt: LearntRest,
    joints: usize,
    /// Factor on the score. With it, chance exceeds the threshold as often as for a moving arm.
    scale: f64,
    threshold: f64,
    base: Base,
    lasting: Lasting,
    /// Present contact.
    end: End,
    /// Size of the previous contact, and the time at which it ended.
    before: Option<(f64, i64)>,
}

impl Rest {
    /// Creates a detection whose score exceeds this `threshold` by chance `per_hour` times an hour.
    pub fn new(learnt: &LearntRest, joints: usize, threshold: f64, per_hour: f64) -> Self {
        Self {
            learnt: learnt.clone(),
            joints,
            scale: threshold / learnt.tail.threshold(per_hour),
            threshold,
            base: Base::new(),
            lasting: Lasting::new(0),
            end: End::default(),
            before: None,
        }
    }

    /// Sets another threshold.
    pub fn retune(&mut self, threshold: f64) {
        self.scale *= threshold / self.threshold;
        self.threshold = threshold;
    }

    pub fn reset(&mut self) {
        self.base.reset();
        self.end.forget();
        self.before = None;
    }

    /// Ends the present contact: the remaining effort is the new reference, and may creep.
    pub fn settle(&mut self) {
        if self.base.mean.is_none() {
            return;
        }
        let size = (self.end.whole() / self.learnt.usual).sqrt();
        self.before = Some((size, self.base.newest_ns));
        self.end.forget();
        self.base.mean = Some(self.base.sums.means[MIDDLE]);
    }

    /// Returns the score of the next sample; `None` while the arm moves, or if it came to rest during a contact.
    /// Creep is followed while the arm is `free` of contacts.
    pub fn score(&mut self, sample: &TwinState, free: bool) -> Option<f64> {
        let now_ns = sample.header.stamp_ns;
        let Some(changes) = self.base.changes(sample, self.joints, free) else {
            self.end.forget();
            self.before = None;
            self.lasting = Lasting::new(now_ns);
            return None;
        };
        let creep = self.before.map_or(0.0, |(size, over_ns)| {
            CREEPS * size * (-((now_ns - over_ns) as f64 * 1e-9) / FADES_S).exp()
        });
        let size = self.learnt.size(&changes) / (1.0 + creep);
        self.base
            .follow(now_ns, free && self.scale * size.powi(2) < self.threshold);
        if free {
            self.end.forget();
        } else if self
            .end
            .step(now_ns, &self.units(&changes[MIDDLE]), &STEADY)
        {
            self.settle();
        }
        Some(self.scale * self.lasting.step(now_ns, size).powi(2))
    }

    /// Returns a change in units of noise.
    fn units(&self, change: &JointArray) -> JointArray {
        let mut units = [0.0; MAX_JOINTS];
        let noise = self.learnt.noise[MIDDLE].iter();
        for ((unit, change), noise) in units.iter_mut().zip(change).zip(noise) {
            *unit = change / noise;
        }
        units
    }
}
