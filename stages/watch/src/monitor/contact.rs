//! Runs of loud blocks and their outcome: a contact, a lasting change, or neither.

use super::super::finding::{Cause, Finding};
use super::super::moments::{Compared, JOINT_KINDS, Moments};
use super::super::touch;
use super::{FRESH, Monitor};

/// Minimum number of quiet blocks after a contact before it can be treated as ended.
/// Tuned: by hand, on no recorded seeds; not swept.
const QUIET: usize = 3;
/// Share of a contact in the quiet blocks below which the contact has ended.
/// Tuned: by hand, on no recorded seeds; not swept.
const OVER: f64 = 0.3;
/// Ratio of a change's gain to the largest gain above which the change is a likely cause of a run.
/// Tuned: by hand, on no recorded seeds; not swept.
const LIKELY: f64 = 0.6;
/// Minimum information in the quiet blocks, in units of noise, to decide whether the cause persists.
/// Statistical: the standard error of a share is then below 1/√10. A share of 1 appears below [`OVER`], by 2.2
/// standard errors, in 1.3 % of cases.
const TELLING: f64 = 10.0;
/// Maximum length of a contact \[blocks\]: 10 s of motion.
/// Chosen: hands push for seconds; a longer limit would delay the report of a lasting change beyond ten seconds.
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
    /// Quiet blocks since the newest loud one.
    quiet: usize,
    /// Whether quiet blocks preceded the run, so that its onset was observed.
    seen: bool,
}

/// Outcome of a run of loud blocks.
pub(super) enum Told {
    /// A contact that ended.
    Contact(Finding),
    /// A lasting change, and its length \[blocks\].
    Lasting(Finding, usize),
    /// A lasting deviation whose onset was not observed.
    Unseen,
}

impl Monitor {
    /// Adds the newest block to the current run of loud blocks. Returns the run's outcome once it is decided.
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
            // Excludes one block on either side, too, because it may contain the contact's start or end.
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
            // Neither ended nor lasting: loud intermittently. It becomes part of the reference.
            self.run = None;
        }
        None
    }

    /// Returns whether the quiet blocks after a run show that its likely causes have ended at all its joints.
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
