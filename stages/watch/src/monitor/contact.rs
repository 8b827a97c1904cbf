//! Loud blocks, and what becomes of a run of them: a contact, a lasting change, or neither.

use super::super::finding::{Cause, Finding};
use super::super::moments::{Compared, JOINT_KINDS, Moments};
use super::super::touch;
use super::{FRESH, Monitor};

/// A contact is over after so many quiet blocks that hold less than this share of it.
const QUIET: usize = 3;
const OVER: f64 = 0.3;
/// What explains this share of what the best does may be behind a run, and so much information (in units of
/// noise) tells whether it still is there.
const LIKELY: f64 = 0.6;
const TELLING: f64 = 10.0;
/// A loud run that lasts longer is none \[blocks\].
const LONGEST_CONTACT: usize = 20;

/// A run of loud blocks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run {
    first_ns: i64,
    joints: u32,
    /// Blocks from its first to its newest loud one, those of them that are loud, and quiet ones since.
    blocks: usize,
    loud: usize,
    quiet: usize,
    /// Whether there was quiet before it since the arm is watched.
    seen: bool,
}

/// What became of a run of loud blocks.
pub(super) enum Told {
    Contact(Finding),
    Lasting(Finding, usize),
    /// It lasts since before anything was watched: nobody saw it begin.
    Unseen,
}

impl Monitor {
    /// Follows loud blocks to their end.
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
            if !run.seen {
                return Some(Told::Unseen);
            }
            finding.cause = Cause::Unknown;
            return Some(Told::Lasting(finding, run.blocks));
        }
        if run.quiet + run.blocks >= FRESH {
            // Neither over nor lasting: loud now and then. It becomes part of the rule.
            self.run = None;
        }
        None
    }

    /// Whether the quiet blocks after a run hold nothing of what explains it at its joints.
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
                // All that may explain it: an effort that is off by a factor is quiet where there is none.
                let mut likely = (0..JOINT_KINDS).filter(|&kind| score.gain[kind] > LIKELY * most);
                likely.all(|kind| {
                    let (share, information) = quiet.share(kind, score.size[kind]);
                    let known = self.noise[j].is_some_and(|noise| information > TELLING * noise);
                    known && share < OVER
                })
            })
    }
}
