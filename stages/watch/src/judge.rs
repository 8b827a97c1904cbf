//! Decides whether the residual changed, when, and what explains it: for each kind of change the generalised
//! likelihood ratio over the instant of change (Basseville and Nikiforov, *Detection of Abrupt Changes*, 1993,
//! section 2.4), in units of the baseline gain of that kind.

mod lasting;

use super::blocks::Ring;
use super::finding::{Cause, Finding};
use super::moments::{BIAS, COULOMB, GAIN, JOINT_KINDS, JointScore};
use super::rows::PAYLOAD;
use super::scale::Scale;
use super::touch;
use super::usual::{BEYOND, Usual};
use super::window::Window;

/// Blocks of motion after which a change is reported: 6.5 s.
/// Tuned: by hand, on no recorded seeds; not swept.
const SOONEST: usize = 13;
/// Blocks of motion after which an ambiguous change is reported: 9 s.
/// Derived: the most whole blocks in ten seconds, less the block in which the change begins and the delay of the
/// filters.
const LATEST: usize = 18;
/// Share of joints with novel motion from which contacts and changes of unknown cause are not reported.
/// Tuned: by hand, on no recorded seeds; not swept.
pub(super) const STRANGE: f64 = 0.03;
/// Blocks without a reported change after which a gain is treated as one without a change.
/// Chosen: longer than a change can take to be reported, [`LATEST`], so that it is not learnt as baseline; more only
/// learns later.
const DELAY: usize = 22;
/// Share of the time since a change in which the motion of a joint may be novel; above it, the change is not
/// reported.
/// Chosen: most of the evidence is then from known motion.
const NEW_MOTION: f64 = 0.5;
/// Ratio of the second largest gain to the largest above which the change is ambiguous.
/// Tuned: by hand, on no recorded seeds; not swept.
const RIVAL: f64 = 0.92;
/// Ratio of the gain of a force on a link to that of a change above which the change is not reported.
/// Tuned: by hand, on no recorded seeds; not swept.
const FORCED: f64 = 1.15;
/// Ratio of the gain of the best change to the sum of the joints' largest gains below which the cause is unknown.
/// Chosen: the change explains more than all other causes together.
const EXPLAINED: f64 = 0.5;
/// Minimum score of a change after a long run of loud blocks, when only its cause is uncertain.
/// Tuned: by hand, on no recorded seeds; not swept.
const DOUBTLESS: f64 = 0.2;
/// Factor on the gain of a constant offset, so that other changes with an equal gain are preferred.
/// Tuned: by hand, on no recorded seeds; not swept.
const OFFSET: f64 = 0.96;
/// Maximum distance of a payload's centre of mass from the frame of the body that carries it \[m\].
/// Physical: tools extend at most 0.5 m beyond the flange, and the flange 0.2 m beyond the frame of the last joint.
const FURTHEST_M: f64 = 0.7;
/// Penalty on a payload's gain for its three additional columns, which gain 3 on average by chance.
/// Statistical: the 99 % quantile of a chi-square variable with three degrees of freedom, 11.3, rounded up.
const COLUMNS_MORE: f64 = 12.0;
/// Minimum baseline gain of a payload per column.
/// Statistical: the mean of a squared standard normal number.
const LEAST_USUAL: f64 = 1.0;

/// The instant at which one kind of change has the largest gain.
#[derive(Debug, Clone, Copy, Default)]
struct Best {
    gain: f64,
    size: f64,
    blocks: usize,
    back: usize,
    novel: f64,
}

/// A kind of change and its joint.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Name {
    Joint(usize, usize),
    Payload,
}

/// A change with its gain.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    name: Name,
    best: Best,
    /// Gain in units of noise, in which all changes are compared.
    normal: f64,
    /// Gain over its threshold.
    score: f64,
}

/// Result of a search in the newest blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Verdict {
    /// No change.
    Nothing,
    /// The arm changed.
    Changed(Finding),
    /// The residual differs from the reference, and no onset was observed.
    Drifted,
}

/// Searches the newest blocks for a change.
#[derive(Debug)]
pub(super) struct Judge {
    window: Window,
    scores: Vec<Option<JointScore>>,
    best: Vec<[Best; JOINT_KINDS]>,
    payload: Best,
    payload_change: [f64; PAYLOAD],
    /// Largest gain of each kind after each of the newest blocks: a ring, `at` is the index of its next entry.
    past: Vec<Vec<[f64; JOINT_KINDS]>>,
    past_payload: Vec<f64>,
    at: usize,
    filled: usize,
}

impl Judge {
    pub fn new(joints: usize) -> Self {
        Self {
            window: Window::new(joints),
            scores: vec![None; joints],
            best: vec![[Best::default(); JOINT_KINDS]; joints],
            payload: Best::default(),
            payload_change: [0.0; PAYLOAD],
            past: vec![vec![[0.0; JOINT_KINDS]; joints]; DELAY],
            past_payload: vec![0.0; DELAY],
            at: 0,
            filled: 0,
        }
    }

    /// Returns the change within the ring, if there is one, and the likelihood ratio of the most likely change over
    /// its threshold (1: just enough to be reported).
    ///
    /// If the deviation `lasts`, there is a change: only its cause is uncertain, and the threshold is lower.
    pub fn judge(&mut self, ring: &Ring, usual: &Usual<'_>, lasts: bool) -> (Verdict, f64) {
        self.search(ring, usual);
        let Some((first, second, all)) = self.contest(usual) else {
            return (Verdict::Nothing, 0.0);
        };
        let score = first.score;
        let rival = second > RIVAL * first.normal;
        let poor = first.normal < EXPLAINED * all;
        let soonest = if rival || poor { LATEST } else { SOONEST };
        let enough = if lasts { DOUBTLESS } else { 1.0 };
        // A payload contains a constant force, its weight, so a force alone cannot explain more.
        let forced = if first.name == Name::Payload {
            1.0
        } else {
            FORCED
        };
        if score < enough
            || first.best.blocks < soonest
            || !self.lasts(ring, usual, &first)
            || touch::strongest(ring, usual, 0, first.best.back).1 > forced * first.normal
        {
            return (Verdict::Nothing, score);
        }
        let strange = first.best.novel > NEW_MOTION || (poor && usual.unlike >= STRANGE);
        if strange || !self.began(ring, usual, &first) {
            return (Verdict::Drifted, score);
        }
        let mut finding = self.finding(usual, &first, ring);
        if poor {
            finding.cause = Cause::Unknown;
            finding.size = 0.0;
            finding.link = None;
        }
        (Verdict::Changed(finding), score)
    }

    /// Stores the gains of this block. Those of `DELAY` blocks ago are treated as gains without a change.
    pub fn remember(&mut self, scales: &mut [[Scale; JOINT_KINDS]], payload: &mut Scale) {
        let (past, past_payload) = (&mut self.past[self.at], &mut self.past_payload[self.at]);
        if self.filled == DELAY {
            for (scale, gain) in scales.iter_mut().flatten().zip(past.iter().flatten()) {
                scale.take_largest(*gain);
            }
            payload.take_largest(*past_payload);
        }
        for (past, best) in past.iter_mut().zip(&self.best) {
            *past = best.map(|best| best.gain);
        }
        *past_payload = (self.payload.gain - COLUMNS_MORE).max(0.0);
        self.at = (self.at + 1) % DELAY;
        self.filled = (self.filled + 1).min(DELAY);
    }

    /// Discards the stored gains.
    pub fn forget(&mut self) {
        self.filled = 0;
    }

    /// Finds the instant of change with the largest gain, for each kind.
    fn search(&mut self, ring: &Ring, usual: &Usual<'_>) {
        self.best.fill([Best::default(); JOINT_KINDS]);
        self.payload = Best::default();
        self.window.clear();
        for back in 0..ring.len() {
            let block = ring.back(back);
            if block.excluded {
                continue;
            }
            self.window.add(block);
            let blocks = self.window.blocks;
            if blocks < Scale::SHORT {
                continue;
            }
            // Novel motion of one joint changes the effort of all joints, so the largest share counts for each.
            let novel = self.window.novel.iter().copied().max().unwrap_or(0) as f64 / blocks as f64;
            let payload = self
                .window
                .scores(usual.references, usual.noise, &mut self.scores);
            for (best, score) in self.best.iter_mut().zip(&self.scores) {
                let Some(score) = score else { continue };
                for (kind, best) in best.iter_mut().enumerate() {
                    if score.gain[kind] > best.gain {
                        *best = Best {
                            gain: score.gain[kind],
                            size: score.size[kind],
                            blocks,
                            back,
                            novel,
                        };
                    }
                }
            }
            if let Some((change, gain)) = payload.solve()
                && gain > self.payload.gain
            {
                self.payload = Best {
                    gain,
                    size: change[0],
                    blocks,
                    back,
                    novel,
                };
                self.payload_change = change;
            }
        }
    }

    /// Returns the change with the largest gain, the second largest gain, and the sum of the joints' largest gains.
    fn contest(&self, usual: &Usual<'_>) -> Option<(Candidate, f64, f64)> {
        let mut first: Option<Candidate> = None;
        let mut second = 0.0;
        let mut all = 0.0;
        let mut enter = |candidate: Candidate| match &mut first {
            Some(best) if candidate.normal <= best.normal => {
                second = f64::max(second, candidate.normal);
            }
            best => {
                second = best.map_or(0.0, |best| best.normal);
                *best = Some(candidate);
            }
        };
        for (j, kinds) in self.best.iter().enumerate() {
            let Some(noise) = usual.noise[j] else {
                continue;
            };
            let mut most: f64 = 0.0;
            for (kind, best) in kinds.iter().enumerate() {
                let scale = &usual.scales[j][kind];
                let Some(value) = scale.usual() else { continue };
                let candidate = Candidate {
                    name: Name::Joint(j, kind),
                    best: *best,
                    normal: best.gain / noise * if kind == BIAS { OFFSET } else { 1.0 },
                    score: best.gain
                        / usual.threshold(scale, value.max(usual.floors[j]), best.novel),
                };
                most = most.max(candidate.normal);
                enter(candidate);
            }
            all += most;
        }
        if let Some(value) = usual.payload.usual()
            && self.is_body()
        {
            let gain = (self.payload.gain - COLUMNS_MORE).max(0.0);
            enter(Candidate {
                name: Name::Payload,
                best: self.payload,
                normal: gain,
                score: gain
                    / usual.threshold(usual.payload, value.max(LEAST_USUAL), self.payload.novel),
            });
        }
        first.map(|first| (first, second, all))
    }

    /// Returns whether the payload's centre of mass is plausible.
    fn is_body(&self) -> bool {
        let [mass, x, y, z] = self.payload_change;
        (x * x + y * y + z * z).sqrt() <= FURTHEST_M * mass.abs()
    }

    /// Returns the finding that reports a change.
    fn finding(&self, usual: &Usual<'_>, first: &Candidate, ring: &Ring) -> Finding {
        let (cause, joints, size) = match first.name {
            Name::Joint(j, kind) => {
                let cause = match kind {
                    BIAS => Cause::TorqueBias,
                    GAIN => Cause::TorqueGain,
                    COULOMB => Cause::CoulombFriction,
                    _ => Cause::ViscousFriction,
                };
                let one = if kind == GAIN { 1.0 } else { 0.0 };
                (cause, 1 << j, one + first.best.size)
            }
            Name::Payload => (Cause::Payload, self.shown(usual), first.best.size),
        };
        Finding {
            cause,
            joints,
            link: None,
            since_ns: ring.back(first.best.back).first_ns,
            size,
            score: first.score,
        }
    }

    /// Returns the joints at which a change of the whole arm is evident: bit j for joint j.
    fn shown(&self, usual: &Usual<'_>) -> u32 {
        let most = |j: usize| {
            let noise = usual.noise[j].unwrap_or(f64::INFINITY);
            let gains = self.best[j].iter().map(|best| best.gain);
            gains.fold(0.0, f64::max) / noise
        };
        (0..self.best.len())
            .filter(|&j| most(j) > BEYOND)
            .fold(0, |joints, j| joints | 1 << j)
    }
}
