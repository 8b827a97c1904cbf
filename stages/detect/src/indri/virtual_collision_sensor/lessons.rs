//! What contact-free recordings say of the bias.

use tauscope_bus::flags;

use super::bias::Bias;
use super::blocks::Blocks;
use super::joint::{Joint, Tuning};
use crate::frame::{LearnError, Lesson};
use tauscope_dynamics::lowpass::Butterworth2;

/// The first bias of a joint is this many times what contact-free data needed, for a motion that was
/// not seen may be worse than all that were.
/// Tuned: on the practice set of cyclic moves (docs/papers.md); not swept.
const SAFETY: f64 = 2.0;
/// Nothing is learnt for so long after a contact \[ns\]: the arm swings out.
/// Tuned: on the practice set of cyclic moves (docs/papers.md); not swept.
const AFTER_CONTACT_NS: i64 = 1_000_000_000;
/// The shortest time that tells anything of a motion \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_S: f64 = 5.0;

/// What a joint's bias would have had to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Needed {
    /// `Coll_Ident` at the end \[effort unit\].
    pub ident: f64,
    /// Mean |R| \[effort unit\].
    pub mean_residue: f64,
}

impl Needed {
    /// `Coll_bias0`: twice the bias that would have avoided every virtual collision, and no less than
    /// the mean residue.
    pub fn first_bias(&self) -> f64 {
        (SAFETY * self.ident).max(self.mean_residue)
    }
}

/// The paper's learning (equations 12 and 13) over the recordings, each joint's block beginning anew
/// in each of them. What somebody labelled as a contact is left out.
pub(super) fn needed(
    detector: &'static str,
    tuning: Tuning,
    joint_count: usize,
    lessons: &[Lesson],
) -> Result<Vec<Needed>, LearnError> {
    // No bias is large enough to keep a virtual collision from being believed.
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

/// Whether something touches the robot, or has just let go of it.
fn is_touched(lesson: &Lesson, stamp_ns: i64) -> bool {
    let contacts = lesson.contacts.as_deref().unwrap_or(&[]);
    contacts.iter().any(|contact| {
        (contact.on_ns..=contact.off_ns.saturating_add(AFTER_CONTACT_NS)).contains(&stamp_ns)
    })
}
