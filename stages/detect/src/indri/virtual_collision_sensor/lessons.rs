//! Learning of the bias from contact-free recordings.

use tauscope_bus::flags;

use super::bias::Bias;
use super::blocks::Blocks;
use super::joint::{Joint, Tuning};
use crate::frame::{LearnError, Lesson};
use tauscope_dynamics::lowpass::Butterworth2;

/// Safety factor on the initial bias of a joint relative to the smallest one that fits contact-free data: an unseen
/// motion may be worse than all seen ones.
/// Chosen: with 1, the first motion with a larger residue than every recorded one raises an alarm. A larger factor
/// misses weaker collisions until the bias has adapted.
const SAFETY: f64 = 2.0;
/// Time after a contact without learning, while the arm's oscillation decays \[ns\].
/// Chosen: an arm swings back onto its path for up to a second (docs/papers.md). A shorter time learns the swing as
/// model error, a longer one discards contact-free motion.
pub(super) const AFTER_CONTACT_NS: i64 = 1_000_000_000;
/// Minimum duration of contact-free motion \[s\].
/// Chosen: a shorter recording rarely holds a whole cycle of the motion, and a larger minimum rejects recordings of
/// fast cycles.
const LEAST_S: f64 = 5.0;

/// Bias that a joint would have needed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Needed {
    /// `Coll_Ident` at the end \[effort unit\].
    pub ident: f64,
    /// Mean |R| \[effort unit\].
    pub mean_residue: f64,
}

impl Needed {
    /// Returns `Coll_bias0`: twice the bias that would have avoided every virtual collision, and at least the mean
    /// residue.
    pub fn first_bias(&self) -> f64 {
        (SAFETY * self.ident).max(self.mean_residue)
    }
}

/// Runs the paper's learning (equations 12 and 13) over the recordings; each joint's block is reset at the start of
/// each recording. Labelled contacts are excluded.
pub(super) fn needed(
    detector: &'static str,
    tuning: Tuning,
    joint_count: usize,
    lessons: &[Lesson],
) -> Result<Vec<Needed>, LearnError> {
    // With an infinite applied bias, the collision test accepts every residue, so every virtual collision is learnt.
    let mut joints = vec![Joint::new(tuning, Bias::new(f64::INFINITY)); joint_count];
    let mut residues = vec![0.0; joint_count];
    let (mut seen, mut seen_s) = (0_u64, 0.0);
    let settling_s =
        Butterworth2::new(tuning.block.cutoff_hz).settling_time_s() + tuning.block.period_s;
    for lesson in lessons {
        let mut blocks = Blocks::new(tuning.block, joint_count);
        let (mut newest_ns, mut elapsed_s) = (None, 0.0);
        for sample in &lesson.samples {
            let stamp_ns = sample.header.stamp_ns;
            if newest_ns.replace(stamp_ns) == Some(stamp_ns) {
                continue;
            }
            let step = blocks.update(sample);
            let dt_s = step.dt_s;
            if step.anew {
                elapsed_s = 0.0;
            }
            elapsed_s += dt_s;
            let counts = elapsed_s >= settling_s
                && sample.header.has(flags::READY)
                && !is_touched(lesson, stamp_ns);
            for (j, joint) in joints.iter_mut().enumerate() {
                let reading = joint.read(dt_s, &step.currents[j]);
                if counts {
                    joint.estimate_bias(&reading);
                    residues[j] += reading.residue;
                }
            }
            if counts {
                seen += 1;
                seen_s += dt_s;
            }
        }
    }
    if seen_s < LEAST_S {
        return Err(LearnError::TooLittle {
            detector,
            wanted: format!("{LEAST_S} s of contact-free motion"),
            found: format!("{seen_s:.1} s"),
        });
    }
    let needed = joints.iter().zip(residues).map(|(joint, sum)| Needed {
        ident: joint.bias.ident(),
        mean_residue: sum / seen as f64,
    });
    Ok(needed.collect())
}

/// Returns whether there is a labelled contact, or there was one less than `AFTER_CONTACT_NS` ago.
fn is_touched(lesson: &Lesson, stamp_ns: i64) -> bool {
    let contacts = lesson.contacts.as_deref().unwrap_or(&[]);
    contacts.iter().any(|contact| {
        (contact.on_ns..=contact.off_ns.saturating_add(AFTER_CONTACT_NS)).contains(&stamp_ns)
    })
}
