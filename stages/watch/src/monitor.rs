//! The monitor: learns the baseline residual of the twin, then detects changes of it.

mod contact;
mod learning;
mod memory;

use super::blocks::{BLOCK_ROWS, BLOCK_S, Known, Ring};
use super::finding::Finding;
use super::judge::{Judge, STRANGE, Verdict};
use super::moments::{JOINT_KINDS, JointScore, Reference};
use super::rows::Row;
use super::scale::{Loudness, Scale};
use super::usual::Usual;
use super::window::Window;
use contact::{Run, Told};

/// Blocks that are judged before they are learned from: 16 s of motion.
/// Chosen: holds the latest report, 18 blocks, and the 8 blocks before its onset; many more would let slow drift look
/// like a change.
const FRESH: usize = 32;
/// Minimum size of a reported deviation, as a share of the joint's root-mean-square effort.
/// Chosen: about the accuracy of effort sensors; less would report their drift, more would hide wear.
const LEAST_SHARE: f64 = 0.01;
/// Share of a joint's known range by which a motion must exceed the range to be novel.
/// Tuned: by hand, on no recorded seeds; not swept.
const SLACK: f64 = 0.1;
/// Newest blocks from which a new robot program is detected.
/// Tuned: by hand, on no recorded seeds; not swept.
const PROGRAM: usize = 20;
/// Share of those blocks, over all joints, with novel motion above which the reference is learnt again.
/// Tuned: by hand, on no recorded seeds; not swept.
const UNLIKE: f64 = 0.4;
/// Time constant of the share of joints whose motion is novel \[blocks\].
/// Tuned: by hand, on no recorded seeds; not swept.
const UNLIKE_BLOCKS: f64 = 60.0;
/// Maximum weight of the baseline gains and energies after a change \[windows or blocks\].
/// Tuned: by hand, on no recorded seeds; not swept.
const AFTER_CHANGE: f64 = 64.0;

/// Result of a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum News {
    /// A contact that ended, or a change of the arm.
    Found(Finding),
    /// The changed arm was learnt and is the new reference.
    Learned,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// Learning the reference.
    Learning {
        /// Whether a change was reported before.
        told: bool,
    },
    /// Detecting changes.
    Watching,
}

/// The state machine of the stage. It has a fixed memory size.
#[derive(Debug)]
pub(super) struct Monitor {
    learn: usize,
    caution: f64,
    phase: Phase,
    ring: Ring,
    references: Vec<Reference>,
    known: Vec<Known>,
    scales: Vec<[Scale; JOINT_KINDS]>,
    payload: Scale,
    loudness: Vec<Loudness>,
    floors: Vec<f64>,
    noise: Vec<Option<f64>>,
    judge: Judge,
    run: Option<Run>,
    /// Blocks since watching began.
    watched: usize,
    /// Running mean of the share of joints whose motion is novel.
    unlike: f64,
    score: f64,
    /// Workspace.
    window: Window,
    scores: Vec<Option<JointScore>>,
    aside: Vec<Reference>,
    energies: Vec<f64>,
}

impl Monitor {
    pub fn new(joints: usize, learn_s: f64, caution: f64) -> Self {
        let learn = (learn_s / BLOCK_S).ceil() as usize;
        let capacity = learn.max(FRESH);
        Self {
            learn,
            caution,
            phase: Phase::Learning { told: false },
            ring: Ring::new(capacity, joints),
            references: vec![Reference::EMPTY; joints],
            known: vec![Known::NONE; joints],
            scales: vec![[Scale::default(); JOINT_KINDS]; joints],
            payload: Scale::default(),
            loudness: vec![Loudness::default(); joints],
            floors: vec![0.0; joints],
            noise: vec![None; joints],
            judge: Judge::new(joints),
            run: None,
            watched: 0,
            unlike: 0.0,
            score: 0.0,
            window: Window::new(joints),
            scores: vec![None; joints],
            aside: vec![Reference::EMPTY; joints],
            energies: Vec::with_capacity(capacity),
        }
    }

    /// Returns the likelihood ratio of the most likely change over its threshold.
    pub fn score(&self) -> f64 {
        self.score
    }

    /// Returns whether the monitor detects changes; otherwise it learns.
    pub fn watches(&self) -> bool {
        self.phase == Phase::Watching
    }

    /// Processes a row. Rows without motion are ignored.
    pub fn take(&mut self, row: &Row) -> Option<News> {
        if row.moving == 0 {
            return None;
        }
        self.ring.open().add(row);
        if self.ring.open().rows < BLOCK_ROWS {
            return None;
        }
        let watches = self.watches();
        if watches && self.ring.len() >= FRESH {
            self.learn_oldest();
            self.ring.keep(FRESH - 1);
        }
        if watches {
            self.listen();
        }
        self.ring.close();
        self.watched += usize::from(watches);
        if watches { self.watch() } else { self.learn() }
    }

    /// Marks the joints with novel motion and the loud joints in the newly completed block.
    fn listen(&mut self) {
        let block = self.ring.open();
        let (mut novel, mut all) = (0.0, 0.0);
        for (j, joint) in block.joints.iter_mut().enumerate() {
            if joint.own.rows < 1.0 {
                continue;
            }
            all += 1.0;
            joint.novel = self.known[j].is_left_by(&joint.ranges, SLACK);
            novel += f64::from(u8::from(joint.novel));
            let energy = self.references[j].energy_per_row(&joint.own);
            let floor = LEAST_SHARE * LEAST_SHARE * self.references[j].effort_square();
            let enough = 2.0 * joint.own.rows >= f64::from(BLOCK_ROWS);
            if enough && !joint.novel && self.loudness[j].is_beyond(energy, floor) {
                block.loud |= 1 << j;
            }
        }
        self.unlike += (novel / f64::max(all, 1.0) - self.unlike) / UNLIKE_BLOCKS;
    }

    /// Judges the newest blocks.
    fn watch(&mut self) -> Option<News> {
        let run = self.follow_run();
        let usual = Usual {
            references: &self.references,
            scales: &self.scales,
            floors: &self.floors,
            noise: &self.noise,
            payload: &self.payload,
            caution: self.caution,
            unlike: self.unlike,
        };
        let lasts = matches!(run, Some(Told::Lasting(..)));
        let (verdict, score) = self.judge.judge(&self.ring, &usual, lasts);
        self.score = score;
        if let Verdict::Changed(finding) = verdict {
            let blocks = (0..self.ring.len())
                .filter(|&back| self.ring.back(back).first_ns >= finding.since_ns)
                .count();
            return Some(self.changed(finding, blocks));
        }
        if self.run.is_none() {
            self.judge.remember(&mut self.scales, &mut self.payload);
        } else {
            self.judge.forget();
        }
        let strange = self.unlike >= STRANGE;
        match run {
            Some(Told::Contact(finding)) if !strange => return Some(News::Found(finding)),
            Some(Told::Lasting(finding, blocks)) if !strange => {
                return Some(self.changed(finding, blocks));
            }
            _ => {}
        }
        let drifted = verdict == Verdict::Drifted && self.ring.len() == FRESH;
        let unseen = matches!(run, Some(Told::Unseen));
        if self.is_unlike() || lasts || unseen || drifted {
            // A new program, drift, or an unknown deviation from the start: learn a new reference first.
            self.phase = Phase::Learning { told: false };
            self.ring.keep(PROGRAM);
            self.judge.forget();
            self.score = 0.0;
        }
        None
    }

    /// Starts to learn a new reference from the newest `blocks`, which follow the change.
    fn changed(&mut self, finding: Finding, blocks: usize) -> News {
        self.references.fill(Reference::EMPTY);
        self.judge.forget();
        self.ring.keep(blocks);
        self.run = None;
        for scale in self.scales.iter_mut().flatten() {
            scale.weigh(AFTER_CHANGE);
        }
        self.payload.weigh(AFTER_CHANGE);
        for loudness in &mut self.loudness {
            loudness.weigh(AFTER_CHANGE);
        }
        self.phase = Phase::Learning { told: true };
        self.score = 0.0;
        News::Found(finding)
    }

    /// Returns whether much of the newest motion is novel; see `UNLIKE`.
    fn is_unlike(&self) -> bool {
        if self.ring.len() < PROGRAM {
            return false;
        }
        let (mut novel, mut all) = (0, 0);
        for joint in (0..PROGRAM).flat_map(|back| &self.ring.back(back).joints) {
            novel += usize::from(joint.novel);
            all += usize::from(joint.own.rows >= 1.0);
        }
        f64::from(novel as u32) > UNLIKE * f64::from(all as u32)
    }

    fn usual(&self) -> Usual<'_> {
        Usual {
            references: &self.references,
            scales: &self.scales,
            floors: &self.floors,
            noise: &self.noise,
            payload: &self.payload,
            caution: self.caution,
            unlike: self.unlike,
        }
    }
}
