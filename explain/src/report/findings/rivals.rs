//! Alternatives of a finding: the reasons for rejection, and the motion that would distinguish equally likely ones.

use super::{Named, place_of, rival};
use crate::inference::{AS_LIKELY, Alternative};
use crate::physics::active::{Active, Hypothesis};
use crate::read::input::Input;
use crate::report::schema::{NextMotion, Rejected, Rival};
use crate::report::{next_motion, sentences};

impl Named {
    /// Records the less likely alternatives of a finding, and the motion that would distinguish the equally likely
    /// ones. Returns the latter. `margin` is the loss of evidence without the finding \[nats\].
    pub(super) fn keep_rivals(
        &mut self,
        active: &Active,
        margin: f64,
        others: &[Alternative],
        input: &Input,
        joints: &[String],
    ) -> Vec<Rival> {
        let (ties, less_likely): (Vec<Alternative>, Vec<Alternative>) =
            others.iter().partition(|other| other.behind < AS_LIKELY);
        // An alternative that explains nothing is not listed.
        for other in less_likely.iter().filter(|other| other.behind <= margin) {
            let (joint, link) = place_of(input, joints, &other.hypothesis);
            self.rejected.push(Rejected {
                effect: other.hypothesis.effect.name.to_owned(),
                joint,
                link,
                reason: format!(
                    "in place of {} it makes the recordings {} times less likely",
                    active.hypothesis.effect.words.noun,
                    sentences::odds(other.behind)
                ),
            });
        }
        let ties: Vec<Hypothesis> = ties.iter().map(|other| other.hypothesis).collect();
        let next = next_motion::of(&active.hypothesis, &ties, input, joints);
        if let Some((next, trajectory)) = next {
            self.keep_motion(next, trajectory);
        }
        ties.iter().map(|tie| rival(input, joints, tie)).collect()
    }

    /// Records a motion to record next, unless the same motion already distinguishes the alternatives of another
    /// finding.
    fn keep_motion(&mut self, mut next: NextMotion, trajectory: String) {
        let mut known = self.next_motions.iter_mut();
        if let Some(known) = known.find(|known| known.sentence == next.sentence) {
            known.separates.extend(next.separates);
            return;
        }
        let Some(file) = &next.trajectory else {
            self.next_motions.push(next);
            return;
        };
        // Two findings of one effect may need different motions of all joints.
        let is_taken = |name: &String| self.trajectories.iter().any(|(taken, _)| taken == name);
        let stem = file.trim_end_matches(".csv");
        let others = (2..).map(|k| format!("{stem}_{k}.csv"));
        let free = std::iter::once(file.clone())
            .chain(others)
            .find(|name| !is_taken(name));
        next.trajectory.clone_from(&free);
        self.trajectories
            .extend(free.map(|name| (name, trajectory)));
        self.next_motions.push(next);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_is_told_once_and_two_of_one_name_have_two_files() {
        let mut named = Named::default();
        for sentence in [
            "Turn the last joints.",
            "Turn the last joints.",
            "Move them slowly.",
        ] {
            let motion = NextMotion {
                separates: Vec::new(),
                sentence: sentence.to_owned(),
                trajectory: Some("next_link_com_all.csv".to_owned()),
            };
            named.keep_motion(motion, format!("rows of: {sentence}"));
        }
        let files: Vec<&str> = named
            .trajectories
            .iter()
            .map(|(name, _)| name.as_str())
            .collect();
        assert_eq!(files, ["next_link_com_all.csv", "next_link_com_all_2.csv"]);
        assert_eq!(named.next_motions.len(), 2);
        assert_eq!(named.next_motions[1].trajectory.as_deref(), Some(files[1]));
    }
}
