//! Runs of loud blocks, and how they end: as a contact, as a lasting change, or as neither.

use super::super::finding::{Cause, Finding};
use super::super::moments::{Compared, JOINT_KINDS, Moments};
use super::super::touch;
use super::{FRESH, Monitor};

/// Quiet blocks after which a contact may have ended.
/// Tuned: by hand, on no recorded seeds; not swept.
const QUIET: usize = 3;
/// A contact has ended if the quiet blocks contain less than this share of it.
/// Tuned: by hand, on no recorded seeds; not swept.
const OVER: f64 = 0.3;
/// A change may be the cause of a run if its gain is above this share of the largest one.
/// Tuned: by hand, on no recorded seeds; not swept.
const LIKELY: f64 = 0.6;
/// Information in the quiet blocks, in units of noise, that is enough to tell whether the cause is still there: the
/// standard error of its share is then below 1/√10.
/// Tuned: by hand, on no recorded seeds; not swept.
const TELLING: f64 = 10.0;
/// A longer run of loud blocks is no contact \[blocks\]: 10 s of motion.
/// Tuned: by hand, on no recorded seeds; not swept.
const LONGEST_CONTACT: usize = 20;

/// A run of loud blocks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run {
    first_ns: i64,
    joints: u32,
    /// Blocks from the first to the newest loud one.
    blocks: usize,
    /// Loud blocks among them.
    loud: usize,
    /// Quiet blocks since.
    quiet: usize,
    /// Whether quiet blocks came before it, so that its begin was seen.
    seen: bool,
}

/// How a run of loud blocks ended.
pub(super) enum Told {
    /// A contact that ended.
    Contact(Finding),
    /// A lasting change, and its blocks.
    Lasting(Finding, usize),
    /// A lasting deviation whose begin was not seen.
    Unseen,
}

impl Monitor {
    /// Adds the newest block to the run of loud blocks, if there is one, and says how the run ended.
    pub(super) fn follow_run(&mut self) -> Option<Told> {
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
                    seen: self.watched > QUIET,
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
            score: self.score,
        };
        if run.quiet >= QUIET && self.is_over(&run) {
            self.run = None;
            let oldest = (run.quiet + run.blocks - 1).min(self.ring.len() - 1);
            let (link, explained) = touch::strongest(&self.ring, &self.usual(), run.quiet, oldest);
            finding.link = (explained > 0.0).then_some(link);
            // With one block on either side, which may contain its begin and its end.
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
            if !run.seen {
                return Some(Told::Unseen);
            }
            finding.cause = Cause::Unknown;
            return Some(Told::Lasting(finding, run.blocks));
        }
        if run.quiet + run.blocks >= FRESH {
            // Neither ended nor lasting: loud now and then. It becomes part of the reference.
            self.run = None;
        }
        None
    }

    /// Whether the quiet blocks after a run show that its likely causes have ended at all its joints.
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
                let most = score.gain.into_iter().fold(0.0, f64::max);
                // Every likely cause is checked: a changed gain, for instance, is quiet where the effort is small.
                let mut likely = (0..JOINT_KINDS).filter(|&kind| score.gain[kind] > LIKELY * most);
                likely.all(|kind| {
                    let (share, information) = quiet.share(kind, score.size[kind]);
                    let known = self.noise[j].is_some_and(|noise| information > TELLING * noise);
                    known && share < OVER
                })
            })
    }
}
