//! What a standing arm's effort is held against: what it was before it was touched.
//!
//! Static friction holds what it likes: where an arm came to rest, what its effort lacks or exceeds is unknown to within all that friction can
//! hold, but it stays. So while the arm stands, the effort's *change* counts, in units of how much it changes while nothing touches the arm; no twin
//! is needed for that. An arm that is about to move changes its effort, too, so a change counts once it has been there for a while and the
//! arm still stands. A touch leaves friction otherwise than it was, and it creeps for seconds: a contact is over where the change has lost most
//! of what it had along the contact, whatever else has stayed. What it is then is the new rest, and for a while so much of the contact's size
//! is needed for another one as may be creep.

use tauscope_bus::{JointArray, MAX_JOINTS, TwinState, flags};

use super::learnt::{ENOUGH_S, LearntRest};
use super::means::borne_out;
use super::pieces::{Piece, marked, quantile};
use super::spans::{LONG, MIDDLE, SHORTEST, WINDOWS_S};
use super::stand::{End, Stand};
use super::sums::Sums;
use super::tail::{Peaks, Tail};

/// A standing arm is no faster than this: one that is about to move changes its effort, too \[rad/s, m/s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const SLOW: f64 = 0.03;
/// A change counts once it has been there for so long to twice as long \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const LASTS_S: f64 = 0.075;
/// Time constant with which the effort at rest is followed while nothing touches the arm \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const FOLLOW_S: f64 = 1.0;
/// So much of a contact may creep behind it.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const CREEPS: f64 = 0.5;
/// How fast that fades \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const FADES_S: f64 = 1.5;
/// What a standing arm does is learnt from at least so much of it \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const LEAST_S: f64 = 10.0;
/// And from at most so many samples.
/// Tuned: for what it costs in time; not swept.
const MOST_SAMPLES: usize = 20_000;
/// A joint's noise is what this share of its changes stays below: what an arm does that is about to move is not noise.
/// Statistical: one standard deviation of Gaussian noise.
const WITHIN_NOISE: f64 = 0.683;
/// The share of contact-free samples whose change stays below the unit of the score.
/// Statistical: what one of a hundred contact-free samples exceeds is the unit of the score at rest, where samples are few.
const USUAL: f64 = 0.99;

/// What has gone is gone, however the rest changes.
const STEADY: JointArray = [0.0; MAX_JOINTS];

/// By window and joint.
type Changes = [JointArray; WINDOWS_S.len()];

impl LearntRest {
    /// Root of the largest squared length of the windows' changes, in units of the usual.
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

/// How long what has lasted: the least of late.
#[derive(Debug)]
struct Lasting {
    begin_ns: i64,
    /// Since then, and in the stretch before; infinite where there is none.
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

/// The effort of a standing arm.
#[derive(Debug)]
struct Base {
    sums: Sums,
    stand: Stand,
    /// Mean effort at rest, while the arm stands and that is known.
    mean: Option<JointArray>,
    newest_ns: i64,
}

impl Base {
    fn new() -> Self {
        Self {
            sums: Sums::new(WINDOWS_S.len()),
            stand: Stand::new(SLOW),
            mean: None,
            newest_ns: 0,
        }
    }

    fn reset(&mut self) {
        self.sums.reset();
        self.stand.reset();
        self.mean = None;
    }

    /// Takes the next sample: how the mean effort over each window has changed against that at rest; nothing while the arm moves, or if it came
    /// to rest when it was not `free` of contacts.
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

    /// What has changed may creep: it is followed, or not.
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

/// Hands out each change of a standing arm that nothing touches, with its stamp and whether it is the first since the arm came to rest.
fn each(all: &[Piece<'_>], joints: usize, mut visit: impl FnMut(i64, bool, &Changes)) {
    for piece in all {
        let mut base = Base::new();
        let mut is_first = true;
        for (sample, _, is_free) in marked(piece) {
            // What was before a contact is not what is behind it.
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

/// Learns from contact-free samples, where an arm stands long enough in them; `hold` keeps noise within what can be believed.
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

/// How unusual a standing arm's effort is.
#[derive(Debug)]
pub(super) struct Rest {
    learnt: LearntRest,
    joints: usize,
    /// What a score is multiplied by, so that it is exceeded by chance as often as that of a moving arm.
    scale: f64,
    threshold: f64,
    base: Base,
    lasting: Lasting,
    /// The contact that goes on.
    end: End,
    /// Size of the contact before, and when it was over.
    before: Option<(f64, i64)>,
}

impl Rest {
    /// One whose score is as unusual at this `threshold` as there should be false alarms an hour.
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

    /// From now on the threshold is another one.
    pub fn retune(&mut self, threshold: f64) {
        self.scale *= threshold / self.threshold;
        self.threshold = threshold;
    }

    pub fn reset(&mut self) {
        self.base.reset();
        self.end.forget();
        self.before = None;
    }

    /// The contact that goes on is over: what is left is the new rest, and may creep.
    pub fn settle(&mut self) {
        if self.base.mean.is_none() {
            return;
        }
        let size = (self.end.whole() / self.learnt.usual).sqrt();
        self.before = Some((size, self.base.newest_ns));
        self.end.forget();
        self.base.mean = Some(self.base.sums.means[MIDDLE]);
    }

    /// The score of the next sample; nothing while the arm moves, nor where it came to rest while something touched it. While it is `free` of
    /// contacts creep is followed.
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

    /// A change in units of noise.
    fn units(&self, change: &JointArray) -> JointArray {
        let mut units = [0.0; MAX_JOINTS];
        let noise = self.learnt.noise[MIDDLE].iter();
        for ((unit, change), noise) in units.iter_mut().zip(change).zip(noise) {
            *unit = change / noise;
        }
        units
    }
}
