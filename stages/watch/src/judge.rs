//! Whether the residual changed, when, and what explains it: for each kind of change the generalised
//! likelihood ratio over the instant of change (Basseville and Nikiforov, *Detection of Abrupt Changes*,
//! 1993, section 2.4), in units of what it explains by chance.

use super::blocks::Ring;
use super::finding::{Cause, Finding};
use super::moments::{BIAS, COULOMB, Compared, GAIN, JOINT_KINDS, JointScore};
use super::rows::PAYLOAD;
use super::scale::Scale;
use super::touch;
use super::usual::{BEYOND, Usual};
use super::window::Window;

/// A change is named after so many blocks of motion; if it is hard to tell from another, after so many: as
/// long as ten seconds of motion allow.
const SOONEST: usize = 13;
const LATEST: usize = 18;
/// From this share of joints on that lately moved unlike ever before, nothing is told that has no name.
pub(super) const STRANGE: f64 = 0.03;
/// A gain counts among those without a change once so many blocks have passed.
const DELAY: usize = 22;
/// Nothing is told of a time in which a joint moved as never before in more than this share of it.
const NEW_MOTION: f64 = 0.5;
/// Parts of the time since the change that must each hold their share of it; longer ones where they tell too
/// little.
const PARTS: usize = 4;
const SHARE: std::ops::RangeInclusive<f64> = 0.4..=2.2;
/// The newest blocks, which by themselves must hold their share, too.
const NEWEST: usize = 2;
/// A part that holds so little information tells nothing: standard errors of its share.
const UNCERTAIN: f64 = 0.2;
/// Blocks before the change that must be there, and that are looked at, to see that it began.
const BEFORE: (usize, usize) = (3, 8);
/// From this share of a name's gain on, another is hard to tell from it.
const RIVAL: f64 = 0.92;
/// A force must explain so much more than a change of the arm to be taken for it.
const FORCED: f64 = 1.15;
/// A name that explains less than this share of what joints show by themselves is none.
const EXPLAINED: f64 = 0.5;
/// Where a change is beyond doubt, a name needs this share of the evidence.
const DOUBTLESS: f64 = 0.2;
/// Of names that explain alike, a constant offset is the last to be believed.
const OFFSET: f64 = 0.96;
/// A payload's centre of mass is no further from the body that carries it \[m\].
const FURTHEST_M: f64 = 0.7;
/// What the three columns more of a payload explain by chance.
const COLUMNS_MORE: f64 = 12.0;

/// The best that was found of one kind.
#[derive(Debug, Clone, Copy, Default)]
struct Best {
    gain: f64,
    size: f64,
    blocks: usize,
    back: usize,
    novel: f64,
}

/// A kind of change at its place.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Name {
    Joint(usize, usize),
    Payload,
}

/// A name with what speaks for it.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    name: Name,
    best: Best,
    /// Gain in units of noise, in which all names compare.
    normal: f64,
    /// Gain in units of what must be exceeded.
    score: f64,
}

/// What the newest blocks say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Verdict {
    /// Nothing that could be said.
    Nothing,
    /// The arm changed.
    Changed(Finding),
    /// The residual is not what it is as a rule, and nobody saw that begin.
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
    /// What each kind explained at most, of the newest blocks; and the place of the next.
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

    /// What changed within the ring, if that can be said; and how far the strongest sign of a change is
    /// beyond what is usual (1: just enough to be told).
    ///
    /// What `lasts` is a deviation that is beyond doubt: only its name is sought, and an unlikely one will do.
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
        // A payload explains all that its weight would, held still in space, and more.
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

    /// Remembers what was found, and lets what is old enough count among what comes without a change.
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

    /// Forgets what was found.
    pub fn forget(&mut self) {
        self.filled = 0;
    }

    /// For each kind, the instant from which on it explains most.
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
            // Where one joint moves as never before, all that it carries and that carries it does.
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

    /// The best name, the gain of the best that is another, and what all joints show by themselves.
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
                score: gain / usual.threshold(usual.payload, value.max(1.0), self.payload.novel),
            });
        }
        first.map(|first| (first, second, all))
    }

    /// Whether the payload that was found can be one.
    fn is_body(&self) -> bool {
        let [mass, x, y, z] = self.payload_change;
        (x * x + y * y + z * z).sqrt() <= FURTHEST_M * mass.abs()
    }

    /// Whether each part of the time since the change holds its share of it, the newest too. A contact that
    /// ended does not, nor one that pushed now here and now there.
    fn lasts(&mut self, ring: &Ring, usual: &Usual<'_>, first: &Candidate) -> bool {
        let blocks = (0..=first.best.back).filter(|&back| !ring.back(back).excluded);
        let per_part = first.best.blocks.div_ceil(PARTS);
        let mut telling = 0;
        self.window.clear();
        // What has just ended shows in the newest second first, or in as much as tells.
        for (at, back) in blocks.clone().enumerate() {
            self.window.add(ring.back(back));
            if at + 1 < NEWEST {
                continue;
            }
            match self.share(usual, first) {
                Some(share) if share < *SHARE.start() => return false,
                Some(_) => break,
                None if 2 * at > first.best.blocks => return false,
                None => {}
            }
        }
        self.window.clear();
        for (at, back) in blocks.enumerate() {
            self.window.add(ring.back(back));
            if self.window.blocks < per_part && at + 1 < first.best.blocks {
                continue;
            }
            // What tells too little by itself is looked at with what came before it.
            if let Some(share) = self.share(usual, first) {
                telling += 1;
                if !SHARE.contains(&share) {
                    return false;
                }
                self.window.clear();
            }
        }
        telling >= 2
    }

    /// Whether the change was seen to begin: blocks before it hold little of it. Otherwise the reference has
    /// drifted away from the arm.
    fn began(&mut self, ring: &Ring, usual: &Usual<'_>, first: &Candidate) -> bool {
        self.window.clear();
        for back in first.best.back + 1..ring.len() {
            let block = ring.back(back);
            if !block.excluded && self.window.blocks < BEFORE.1 {
                self.window.add(block);
            }
        }
        let share = self.share(usual, first);
        self.window.blocks >= BEFORE.0 && share.is_none_or(|share| share < *SHARE.start())
    }

    /// Share of the change that the window holds; `None` if it tells nothing of it.
    fn share(&mut self, usual: &Usual<'_>, first: &Candidate) -> Option<f64> {
        let (share, information, noise) = match first.name {
            Name::Joint(j, kind) => {
                let compared = Compared::new(&self.window.own[j], &usual.references[j])?;
                let (share, information) = compared.share(kind, first.best.size);
                (share, information, usual.noise[j]?)
            }
            Name::Payload => {
                let window = &self.window;
                let score = window.scores(usual.references, usual.noise, &mut self.scores);
                let (share, information) = score.share(&self.payload_change);
                (share, information, 1.0)
            }
        };
        (information > noise / (UNCERTAIN * UNCERTAIN)).then_some(share)
    }

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

    /// The joints that show a change of the whole arm.
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
