//! Learns how the twin is off as a rule, then watches for what is not the rule.

use super::blocks::{BLOCK_ROWS, BLOCK_S, Ranges, Ring};
use super::finding::{Cause, Finding};
use super::judge::{Judge, Usual, touched};
use super::moments::{Compared, JOINT_KINDS, JointScore, Moments, Reference};
use super::rows::Row;
use super::scale::{Loudness, Scale};
use super::window::Window;

/// The newest blocks that are judged and not yet learned from.
const FRESH: usize = 32;
/// The reference forgets with this time constant of motion \[s\].
const MEMORY_S: f64 = 300.0;
/// A deviation below this share of a joint's usual effort is never told.
const LEAST_SHARE: f64 = 0.01;
/// A motion is novel where it leaves the known range of a joint by this share of it.
const SLACK: f64 = 0.1;
/// Of so many blocks, and when this share of joints moves unlike ever before, the reference is learned anew.
const PROGRAM: usize = 20;
const UNLIKE: f64 = 0.4;
/// The share is remembered over so many blocks; above this one no contact is told.
const UNLIKE_BLOCKS: f64 = 60.0;
const STRANGE: f64 = 0.05;
/// A contact is over after so many quiet blocks that hold less than this share of it.
const QUIET: usize = 3;
const OVER: f64 = 0.3;
/// A loud run that lasts longer is none \[blocks\].
const LONGEST_CONTACT: usize = 20;
/// After a change what was usual weighs no more than so many windows.
const AFTER_CHANGE: f64 = 64.0;
/// A block whose energy is so many times the median is left out of what is learned.
const OUTLIER: f64 = 25.0;

/// What a row brought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum News {
    /// A contact that is over, or a change of the arm.
    Found(Finding),
    /// A changed arm was learned: from here on it is the rule.
    Learned,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// From motion of the arm as it is; after a change that was told, or in silence.
    Learning {
        told: bool,
    },
    Watching,
}

/// A run of loud blocks.
#[derive(Debug, Clone, Copy)]
struct Run {
    first_ns: i64,
    joints: u32,
    /// Blocks from its first to its newest loud one, those of them that are loud, and quiet ones since.
    blocks: usize,
    loud: usize,
    quiet: usize,
}

/// The state machine behind the stage. Its memory is fixed.
#[derive(Debug)]
pub(super) struct Monitor {
    learn: usize,
    caution: f64,
    phase: Phase,
    ring: Ring,
    references: Vec<Reference>,
    ranges: Vec<Ranges>,
    scales: Vec<[Scale; JOINT_KINDS]>,
    payload: Scale,
    loudness: Vec<Loudness>,
    floors: Vec<f64>,
    noise: Vec<Option<f64>>,
    judge: Judge,
    run: Option<Run>,
    /// Share of joints that lately moved unlike ever before.
    unlike: f64,
    score: f64,
    /// Room to work in.
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
            ranges: vec![Ranges::NONE; joints],
            scales: vec![[Scale::default(); JOINT_KINDS]; joints],
            payload: Scale::default(),
            loudness: vec![Loudness::default(); joints],
            floors: vec![0.0; joints],
            noise: vec![None; joints],
            judge: Judge::new(joints),
            run: None,
            unlike: 0.0,
            score: 0.0,
            window: Window::new(joints),
            scores: vec![None; joints],
            aside: vec![Reference::EMPTY; joints],
            energies: Vec::with_capacity(capacity),
        }
    }

    /// How far the strongest sign of a change is beyond what is usual.
    pub fn score(&self) -> f64 {
        self.score
    }

    /// Whether it watches, rather than learns.
    pub fn watches(&self) -> bool {
        self.phase == Phase::Watching
    }

    /// Takes a row.
    pub fn take(&mut self, row: &Row) -> Option<News> {
        if row.moving == 0 {
            return None;
        }
        self.ring.open().add(row);
        if self.ring.open().rows < BLOCK_ROWS {
            return None;
        }
        let watches = self.watches();
        if watches && self.ring.len() == FRESH {
            self.learn_oldest();
        }
        if watches {
            self.listen();
        }
        self.ring.close();
        if watches { self.watch() } else { self.learn() }
    }

    /// Marks in the block that is complete what is novel in its motion and which joints are loud.
    fn listen(&mut self) {
        let block = self.ring.open();
        let (mut novel, mut all) = (0.0, 0.0);
        for (j, joint) in block.joints.iter_mut().enumerate() {
            if joint.own.rows < 1.0 {
                continue;
            }
            all += 1.0;
            joint.novel = self.ranges[j].is_left_by(&joint.ranges, SLACK);
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
        let (found, score) = self.judge.judge(&self.ring, &usual, lasts);
        self.score = score;
        if let Some(finding) = found {
            let blocks = (0..self.ring.len())
                .filter(|&back| self.ring.back(back).first_ns >= finding.since_ns)
                .count();
            return Some(self.changed(finding, blocks));
        }
        let strange = self.unlike >= STRANGE;
        match run {
            Some(Told::Contact(finding)) if !strange => return Some(News::Found(finding)),
            Some(Told::Lasting(finding, blocks)) if !strange => {
                return Some(self.changed(finding, blocks));
            }
            _ => {}
        }
        if self.is_unlike() || lasts {
            // Another program: nothing can be said before it is known.
            self.phase = Phase::Learning { told: false };
            self.ring.keep(PROGRAM);
            self.score = 0.0;
        }
        None
    }

    /// A change was found: what follows it is the rule from now on.
    fn changed(&mut self, finding: Finding, blocks: usize) -> News {
        self.references.fill(Reference::EMPTY);
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

    /// Whether most of the newest motion is unlike what the reference has seen.
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

    /// Follows loud blocks to their end.
    fn follow_run(&mut self) -> Option<Told> {
        let newest = self.ring.back(0);
        let (loud, first_ns) = (newest.loud, newest.first_ns);
        let run = match (&mut self.run, loud) {
            (None, 0) => return None,
            (None, _) => {
                self.run = Some(Run {
                    first_ns,
                    joints: loud,
                    blocks: 1,
                    loud: 1,
                    quiet: 0,
                });
                return None;
            }
            (Some(run), 0) => {
                run.quiet += 1;
                run
            }
            (Some(run), _) => {
                run.blocks += run.quiet + 1;
                run.loud += 1;
                run.quiet = 0;
                run.joints |= loud;
                run
            }
        };
        let run = *run;
        let mut finding = Finding {
            cause: Cause::Contact,
            joints: run.joints,
            link: None,
            since_ns: run.first_ns,
            size: 0.0,
            score: 0.0,
        };
        if run.quiet >= QUIET && self.is_over(&run) {
            self.run = None;
            let oldest = (run.quiet + run.blocks - 1).min(self.ring.len() - 1);
            finding.link = touched(&self.ring, &self.usual(), run.quiet, oldest);
            // One block around it: its beginning and its end.
            for back in run.quiet - 1..=(oldest + 1).min(self.ring.len() - 1) {
                let block = self.ring.back_mut(back);
                block.excluded = true;
                for (j, joint) in block.joints.iter().enumerate() {
                    if joint.own.rows >= 1.0 {
                        let energy = self.references[j].energy_per_row(&joint.own);
                        self.loudness[j].grow_used_to(energy);
                    }
                }
            }
            return Some(Told::Contact(finding));
        }
        if run.blocks > LONGEST_CONTACT && 2 * run.loud > run.blocks {
            finding.cause = Cause::Unknown;
            return Some(Told::Lasting(finding, run.blocks));
        }
        if run.quiet + run.blocks >= FRESH {
            // Neither over nor lasting: loud now and then. It becomes part of the rule.
            self.run = None;
        }
        None
    }

    /// Whether the quiet blocks after a run hold nothing of what explains it best at one of its joints.
    fn is_over(&self, run: &Run) -> bool {
        let oldest = (run.quiet + run.blocks - 1).min(self.ring.len() - 1);
        (0..self.references.len())
            .filter(|j| run.joints & (1 << j) != 0)
            .all(|j| {
                let sum = |from: usize, to: usize| {
                    let mut sum = Moments::ZERO;
                    (from..=to).for_each(|back| sum.add(&self.ring.back(back).joints[j].own, 1.0));
                    sum
                };
                let (loud, quiet) = (sum(run.quiet, oldest), sum(0, run.quiet - 1));
                let reference = &self.references[j];
                let (Some(loud), Some(quiet)) = (
                    Compared::new(&loud, reference),
                    Compared::new(&quiet, reference),
                ) else {
                    return false;
                };
                let score = loud.joint();
                let best =
                    (0..JOINT_KINDS).max_by(|&a, &b| score.gain[a].total_cmp(&score.gain[b]));
                let Some(kind) = best else { return false };
                let (share, information) = quiet.share(kind, score.size[kind]);
                information > 10.0 * self.noise[j].unwrap_or(f64::INFINITY) && share < OVER
            })
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

    /// Learns from the oldest blocks what is usual, and lets the oldest of all become part of the reference.
    fn learn_oldest(&mut self) {
        let oldest = self.ring.len() - 1;
        for blocks in [Scale::SHORT, Scale::LONG] {
            self.window.clear();
            for back in oldest + 1 - blocks..=oldest {
                let block = self.ring.back(back);
                if block.excluded {
                    self.window.clear();
                    break;
                }
                self.window.add(block);
            }
            if self.window.blocks == blocks {
                self.aside.copy_from_slice(&self.references);
                self.learn_window(blocks, true, true);
            }
        }
        let block = self.ring.back(oldest);
        if block.excluded {
            return;
        }
        for (j, joint) in block.joints.iter().enumerate() {
            if joint.own.rows < 1.0 {
                continue;
            }
            if !joint.novel {
                let energy = self.references[j].energy_per_row(&joint.own);
                self.loudness[j].take(energy);
            }
            let moved_s = joint.own.rows / f64::from(BLOCK_ROWS) * BLOCK_S;
            let mut moments = self.references[j].moments;
            moments.scale((-moved_s / MEMORY_S).exp());
            moments.add(&joint.own, 1.0);
            self.references[j] = Reference::of(moments);
            self.ranges[j].join(&joint.ranges);
        }
        self.settle();
    }

    /// Learns from the window what is usual beside the references set aside.
    fn learn_window(&mut self, blocks: usize, joints: bool, payload: bool) {
        let body = self
            .window
            .scores(&self.aside, &self.noise, &mut self.scores);
        for (j, score) in self.scores.iter().enumerate() {
            let moves = self.window.own[j].rows >= 0.3 * blocks as f64 * f64::from(BLOCK_ROWS);
            if let Some(score) = score.filter(|_| joints && moves) {
                for (scale, gain) in self.scales[j].iter_mut().zip(score.gain) {
                    scale.take(blocks, gain);
                }
            }
        }
        if payload && let Some((change, gain)) = body.solve() {
            self.payload.take(blocks, gain / change.len() as f64);
        }
    }

    /// Works out what follows from references and scales.
    fn settle(&mut self) {
        for j in 0..self.references.len() {
            let rows = FRESH as f64 / 2.0 * f64::from(BLOCK_ROWS);
            let least = LEAST_SHARE * LEAST_SHARE * self.references[j].effort_square();
            // What a deviation of that size explains in a long window is just enough to be told.
            self.floors[j] = least * rows / 40.0;
            let usual = self.scales[j].iter().filter_map(Scale::usual);
            let (count, sum) = usual.fold((0.0, 0.0), |(n, sum), value| (n + 1.0, sum + value));
            self.noise[j] = (count > 0.0).then(|| (sum / count).max(self.floors[j]));
        }
    }

    /// Learns the reference once there are blocks enough.
    fn learn(&mut self) -> Option<News> {
        if self.ring.len() < self.learn {
            return None;
        }
        let Phase::Learning { told } = self.phase else {
            return None;
        };
        self.aside.copy_from_slice(&self.references);
        self.fit();
        self.leave_out_outliers();
        self.fit();
        self.learn_scales();
        self.ring.keep(0);
        self.run = None;
        self.phase = Phase::Watching;
        told.then_some(News::Learned)
    }

    /// The references of what was learned now, and as much of what was known before, which stands aside.
    fn fit(&mut self) {
        for j in 0..self.references.len() {
            let mut moments = Moments::ZERO;
            for back in 0..self.ring.len() {
                let block = self.ring.back(back);
                if !block.excluded {
                    moments.add(&block.joints[j].own, 1.0);
                    self.ranges[j].join(&block.joints[j].ranges);
                }
            }
            let mut before = self.aside[j].moments;
            before.scale((moments.rows / before.rows.max(1.0)).min(1.0));
            moments.add(&before, 1.0);
            self.references[j] = Reference::of(moments);
        }
    }

    fn leave_out_outliers(&mut self) {
        for j in 0..self.references.len() {
            self.energies.clear();
            let reference = self.references[j];
            let energy = |ring: &Ring, back: usize| {
                let own = &ring.back(back).joints[j].own;
                (own.rows >= 1.0).then(|| reference.energy_per_row(own))
            };
            for back in 0..self.ring.len() {
                self.energies.extend(energy(&self.ring, back));
            }
            if self.energies.len() < 8 {
                continue;
            }
            self.energies.sort_unstable_by(f64::total_cmp);
            let median = self.energies[self.energies.len() / 2];
            let floor = LEAST_SHARE * LEAST_SHARE * reference.effort_square();
            for back in 0..self.ring.len() {
                if energy(&self.ring, back).is_some_and(|e| e > OUTLIER * median.max(floor)) {
                    self.ring.back_mut(back).excluded = true;
                }
            }
        }
    }

    /// What is usual, from windows beside a reference that has not seen them.
    fn learn_scales(&mut self) {
        self.settle();
        for blocks in [1, Scale::SHORT, Scale::LONG] {
            self.leave_out(blocks, true);
        }
        self.settle();
        // In units of the noise, which is known only now.
        for blocks in [Scale::SHORT, Scale::LONG] {
            self.leave_out(blocks, false);
        }
    }

    /// Leaves out each window of so many blocks in turn, and learns from it.
    fn leave_out(&mut self, blocks: usize, joints: bool) {
        for newest in 0..(self.ring.len() + 1).saturating_sub(blocks) {
            self.window.clear();
            for back in newest..newest + blocks {
                let block = self.ring.back(back);
                if !block.excluded {
                    self.window.add(block);
                }
            }
            if self.window.blocks < blocks {
                continue;
            }
            for (j, aside) in self.aside.iter_mut().enumerate() {
                let mut moments = self.references[j].moments;
                moments.add(&self.window.own[j], -1.0);
                *aside = Reference::of(moments);
            }
            if blocks > 1 {
                self.learn_window(blocks, joints, !joints);
                continue;
            }
            for (j, loudness) in self.loudness.iter_mut().enumerate() {
                if self.window.own[j].rows >= 1.0 {
                    loudness.take(self.aside[j].energy_per_row(&self.window.own[j]));
                }
            }
        }
    }
}

/// What became of a run of loud blocks.
enum Told {
    Contact(Finding),
    Lasting(Finding, usize),
}
