//! Lowers the confidence of findings that others make doubtful.

use std::collections::{BTreeMap, BTreeSet};

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{Against, PAYLOAD_PICKUP, PlaceKind, UNKNOWN};

use crate::data::problem::Problem;
use crate::data::work::Untried;
use crate::physics::active::{Active, Hypothesis, TimeKind};
use crate::report::schema::Finding;
use crate::select::evidence::PATCH;
use crate::select::plausible::at_bound;
use tauscope_dynamics::kinematic_tree::bearing;

use super::Named;
use super::far_out::far_out;
use super::odd_robot::{imitates, oddities};

/// Highest confidence of a doubted finding.
/// Statistical: just below even odds.
pub(super) const DOUBTED: f64 = 0.45;
/// What explains less than this share of the largest finding is doubted beside another simulation, whose own errors are
/// larger than those of smoothing.
/// Tuned: by hand, on no recorded seeds; not swept.
const PATCH_OF_FOREIGN: f64 = 0.05;
/// Highest confidence of what no other name was tried in the place of, because the search had reached its bound.
/// Tuned: by hand, below what is sure; not swept.
const UNRIVALLED: f64 = 0.85;
/// Pushes in different recordings come at the same time if their times differ by less than this \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const SAME_TIME_S: f64 = 0.3;
/// Pushes are doubted if they come at the same time in at least this many recordings.
/// Tuned: by hand, on no recorded seeds; not swept.
const TOO_OFTEN: usize = 3;

/// What warms up within a shorter time is no gear \[s\].
/// Physical: kilograms of steel and some ten watts of loss, so minutes.
const LEAST_WARMING_S: f64 = 10.0;
/// What fades within this share of the longest recording is over soon after its start, and is not followed further.
/// Physical: after three times that, 5 % are left; the rest of the recording shows nothing of it.
const SOON: f64 = 0.2;

fn doubt_it(finding: &mut Finding) {
    finding.confidence = finding.confidence.min(DOUBTED);
}

/// Lowers the confidence of doubtful findings and adds notes with the reasons.
pub fn doubt(named: &mut Named, problem: &Problem, actives: &[Active]) {
    let said = actives.iter().filter(|a| !a.hypothesis.is_torque_scale());
    let lengths_s = problem.tracks.iter().map(|track| track.track.time_s.last());
    let longest_s = lengths_s.flatten().copied().fold(0.0, f64::max);
    let odd = if problem.is_foreign {
        Vec::new()
    } else {
        oddities(&problem.model)
    };
    let unrivalled = problem.work.untried().contains(&Untried::OtherNames);
    for (finding, active) in named.findings.iter_mut().zip(said) {
        if unrivalled {
            doubt_unrivalled(finding, active.hypothesis);
        }
        if !odd.is_empty() && imitates(active.hypothesis.effect) {
            doubt_it(finding);
        }
        if is_shadowed(&problem.model, actives, active.hypothesis) {
            doubt_it(finding);
        }
        doubt_warming(finding, longest_s, at_bound(active));
        if let Some(says) = far_out(finding, &problem.model) {
            finding.sentence += says;
            doubt_it(finding);
        }
    }
    named.notes.extend(odd);
    if problem.is_foreign {
        doubt_below(PATCH_OF_FOREIGN, &mut named.findings);
    }
    let pushed = doubt_pushes(&mut named.findings, problem.tracks.len());
    named.notes.extend(pushed);
    doubt_patched_pushes(&mut named.findings);
}

/// Lowers the confidence of a finding that no other name was tried in the place of. Plain friction has few rivals.
fn doubt_unrivalled(finding: &mut Finding, hypothesis: Hypothesis) {
    if !hypothesis.is_plain_friction() {
        finding.confidence = finding.confidence.min(UNRIVALLED);
    }
}

/// Doubts that a joint warms up with a time constant that recordings of at most `longest_s` do not show, or that is the least
/// or the longest of all (`at_bound`), and says what they show.
fn doubt_warming(finding: &mut Finding, longest_s: f64, at_bound: bool) {
    let time_s = finding.parameters.get("time_constant_s");
    let Some(time_s) = time_s.and_then(serde_json::Value::as_f64) else {
        return;
    };
    let says = if time_s > longest_s {
        " This time is longer than each recording, so the recordings do not show where the friction ends: a drift as well."
    } else if at_bound || time_s < LEAST_WARMING_S.min(SOON * longest_s) {
        " No gear warms up so fast: it is something that passes soon after the start of each recording, such as a brake or \
         grease that has set."
    } else {
        return;
    };
    finding.sentence += says;
    doubt_it(finding);
}

/// Doubts a push that only corrects another finding: one that lasts exactly as long as a picked-up payload is held, and
/// one of two that overlap on different links and explain next to nothing.
fn doubt_patched_pushes(findings: &mut [Finding]) {
    let largest = findings.iter().map(|f| f.explains).fold(0.0, f64::max);
    let is_patch = |push: &Finding| {
        let corrects = |other: &Finding| match &other.recording {
            None => other.effect == PAYLOAD_PICKUP.name && last_equally_long(push, other),
            Some(_) => {
                push.explains < PATCH * largest
                    && other.explains < PATCH * largest
                    && other.recording == push.recording
                    && other.link != push.link
                    && overlap(push, other)
            }
        };
        push.recording.is_some() && push.link.is_some() && findings.iter().any(corrects)
    };
    let patches: Vec<bool> = findings.iter().map(is_patch).collect();
    let doubted = findings.iter_mut().zip(patches).filter(|(_, patch)| *patch);
    doubted.for_each(|(finding, _)| doubt_it(finding));
}

/// Whether two findings begin and end at the same time.
fn last_equally_long(a: &Finding, b: &Finding) -> bool {
    let apart = |a: Option<f64>, b: Option<f64>| Some((a? - b?).abs());
    let starts = apart(a.t_start, b.t_start);
    let ends = apart(a.t_end, b.t_end);
    starts
        .zip(ends)
        .is_some_and(|(s, e)| s.max(e) < SAME_TIME_S)
}

/// Whether two findings of one recording act at one time.
fn overlap(a: &Finding, b: &Finding) -> bool {
    let before = |a: Option<f64>, b: Option<f64>| a.zip(b).is_some_and(|(a, b)| a < b);
    before(a.t_start, b.t_end) && before(b.t_start, a.t_end)
}

/// Doubts findings that explain next to nothing beside the largest one. Called where the explanation does not carry over
/// to held-out recordings: such findings may only patch an error elsewhere.
pub fn doubt_patches(findings: &mut [Finding]) {
    doubt_below(PATCH, findings);
}

/// Doubts findings that explain less than this share of what the largest one does.
fn doubt_below(share: f64, findings: &mut [Finding]) {
    let largest = findings.iter().map(|f| f.explains).fold(0.0, f64::max);
    // What is called unknown claims no more than that something is there.
    let small = |finding: &&mut Finding| {
        finding.explains < share * largest && finding.effect != UNKNOWN.name
    };
    for finding in findings.iter_mut().filter(small) {
        doubt_it(finding);
    }
}

/// Whether a finding of a body or of gravity is doubtful because of an unnamed curve in a joint that carries the body. The
/// curve may contain part of the body's weight, and the finding part of the curve's cause.
fn is_shadowed(model: &Model, actives: &[Active], hypothesis: Hypothesis) -> bool {
    let lasts = hypothesis.time_kind() == TimeKind::Always && hypothesis.lasts();
    let carriers = match hypothesis.effect.place {
        PlaceKind::Link | PlaceKind::Tool if lasts => bearing(model, hypothesis.place.link),
        PlaceKind::Base => (0..model.dof()).collect(),
        _ => return false,
    };
    actives.iter().any(|active| {
        let weighs = active.curve.as_ref().is_some_and(|curve| {
            !curve.by_direction
                && matches!(
                    curve.against,
                    Against::Position | Against::Acceleration | Against::Load
                )
        });
        weighs && carriers.contains(&active.hypothesis.place.joint)
    })
}

/// Doubts pushes on one link that come at the same time in each of `recordings`, with a note: they belong to the robot's
/// programme.
fn doubt_pushes(findings: &mut [Finding], recordings: usize) -> Vec<String> {
    let mut by_link: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (i, finding) in findings.iter().enumerate() {
        if let (Some(_), Some(link)) = (&finding.recording, &finding.link) {
            by_link.entry(link.clone()).or_default().push(i);
        }
    }
    let mut notes = Vec::new();
    for (link, all) in by_link {
        let together = |&i: &usize| last_equally_long(&findings[i], &findings[all[0]]);
        let same: Vec<usize> = all.iter().copied().filter(together).collect();
        let names: BTreeSet<&String> = same
            .iter()
            .filter_map(|&i| findings[i].recording.as_ref())
            .collect();
        if names.len() < recordings.max(TOO_OFTEN) {
            continue;
        }
        let from = findings[same[0]].t_start.unwrap_or(f64::NAN);
        let to = findings[same[0]].t_end.unwrap_or(f64::NAN);
        notes.push(format!(
            "Link {link} is pushed in every recording from {from:.1} to {to:.1} s. This is probably part of the robot's programme, \
             e.g. carrying or pressing something, and not a push from outside. Other recordings are predicted without it."
        ));
        for i in same {
            doubt_it(&mut findings[i]);
        }
    }
    notes
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use tauscope_dynamics::terms::{Table, effect};

    use super::*;
    use crate::fit::body_prior::tests::model;
    use crate::physics::active::Whereabouts;

    fn hypothesis(name: &str, joint: usize, link: usize) -> Hypothesis {
        let place = Whereabouts {
            joint,
            link,
            ..Whereabouts::default()
        };
        let effect = effect(name).unwrap();
        Hypothesis { effect, place }
    }

    /// A curve in a joint.
    fn curve(joint: usize, against: Against) -> Active {
        Active {
            hypothesis: hypothesis("unknown", joint, 0),
            coordinates: vec![1.0; 3],
            curve: Some(Table {
                against,
                of_joint: joint,
                by_direction: false,
                period: None,
                knots: vec![-1.0, 0.0, 1.0],
                values: vec![1.0; 3],
            }),
        }
    }

    #[test]
    fn a_mass_is_doubted_beside_something_unknown_that_weighs_on_a_joint_that_carries_it() {
        let model = model();
        let link = |joint: usize| model.joints()[joint].child_link;
        let mass = |joint: usize| hypothesis("link_mass", 0, link(joint));
        let doubted = |against: Against, hypothesis: Hypothesis| {
            is_shadowed(&model, &[curve(2, against)], hypothesis)
        };
        assert!(doubted(Against::Position, mass(4)));
        assert!(doubted(Against::Position, hypothesis("base_tilt", 0, 0)));
        // The joint does not carry it, friction does not weigh, and other names are no bodies.
        assert!(!doubted(Against::Position, mass(1)));
        assert!(!doubted(Against::Velocity, mass(4)));
        let friction = hypothesis("coulomb_friction", 4, 0);
        assert!(!doubted(Against::Position, friction));
    }

    /// A push on a link in a recording.
    fn push(recording: &str, start_s: f64) -> Finding {
        Finding {
            effect: "external_push".to_owned(),
            joint: None,
            link: Some("forearm".to_owned()),
            parameters: BTreeMap::new(),
            intervals_95: BTreeMap::new(),
            in_amperes: false,
            slides: false,
            confidence: 0.99,
            recording: Some(recording.to_owned()),
            t_start: Some(start_s),
            t_end: Some(start_s + 1.0),
            explains: 0.3,
            over_rest: 9.0,
            effort_rms: 1.0,
            evidence_nats: 40.0,
            equivalent_to: Vec::new(),
            sentence: String::new(),
        }
    }

    #[test]
    fn what_no_other_name_was_tried_in_the_place_of_is_not_sure_unless_it_is_plain_friction() {
        let said = |name: &str, confidence: f64| {
            let mut finding = push("a", 2.0);
            finding.confidence = confidence;
            doubt_unrivalled(&mut finding, hypothesis(name, 1, 0));
            finding.confidence
        };
        assert!(said("joint_zero_offset", 0.99) <= UNRIVALLED);
        assert!(said("coulomb_friction", 0.99) > UNRIVALLED);
        // What was doubted before is not believed more.
        assert!(said("joint_zero_offset", 0.3) < 0.31);
    }

    #[test]
    fn what_explains_next_to_nothing_is_doubted_where_the_whole_does_not_carry_over() {
        let mut found = [push("a", 2.0), push("b", 5.0), push("c", 7.0)];
        for (finding, explains) in found.iter_mut().zip([0.9, 0.03, 0.01]) {
            finding.explains = explains;
        }
        doubt_patches(&mut found);
        let confidence = found.map(|finding| finding.confidence);
        assert!(confidence[0] > 0.9 && confidence[1] > 0.9 && confidence[2] <= DOUBTED);
    }

    #[test]
    fn a_joint_that_warms_up_within_seconds_or_longer_than_it_was_seen_is_doubted() {
        let at = |time_s: f64| {
            let mut warm = push("a", 2.0);
            let time = serde_json::Value::from(time_s);
            warm.parameters.insert("time_constant_s".to_owned(), time);
            doubt_warming(&mut warm, 30.0, false);
            (warm.confidence <= DOUBTED, warm.sentence)
        };
        let (doubted, said) = at(3.5);
        assert!(doubted && said.contains("soon after the start"), "{said}");
        let (doubted, said) = at(70.0);
        assert!(
            doubted && said.contains("longer than each recording"),
            "{said}"
        );
        assert_eq!(at(12.0), (false, String::new()));
        // In short recordings of a simulated cell nothing else can be seen.
        let mut short = push("a", 2.0);
        short
            .parameters
            .insert("time_constant_s".to_owned(), serde_json::Value::from(5.0));
        doubt_warming(&mut short, 10.0, false);
        assert!(short.confidence > 0.9);
    }

    #[test]
    fn a_push_as_long_as_a_payload_is_held_is_doubted() {
        let mut found = [push("a", 2.0), push("a", 2.1), push("b", 2.6)];
        found[0].effect = PAYLOAD_PICKUP.name.to_owned();
        found[0].recording = None;
        doubt_patched_pushes(&mut found);
        let confidence = found.map(|finding| finding.confidence);
        assert!(confidence[0] > 0.9 && confidence[1] <= DOUBTED && confidence[2] > 0.9);
    }

    #[test]
    fn two_pushes_at_once_on_different_links_are_doubted_if_they_explain_next_to_nothing() {
        let both = |explains: f64| {
            let mut found = [push("a", 0.0), push("b", 2.0), push("b", 2.5)];
            found[0].explains = 0.9;
            found[1].explains = explains;
            found[2].explains = explains;
            found[2].link = Some("hand".to_owned());
            doubt_patched_pushes(&mut found);
            found.map(|finding| finding.confidence <= DOUBTED)
        };
        assert_eq!(both(0.001), [false, true, true]);
        assert_eq!(both(0.3), [false, false, false]);
    }

    #[test]
    fn pushes_at_the_same_time_in_every_recording_are_doubted() {
        let every = || vec![push("a", 2.0), push("b", 2.1), push("c", 1.9)];
        let mut pushes = every();
        let notes = doubt_pushes(&mut pushes, 3);
        assert!(pushes.iter().all(|push| push.confidence <= DOUBTED));
        assert!(notes[0].contains("Link forearm is pushed in every recording"));
        // In one of the recordings there is none, or at another time.
        for (mut pushes, recordings) in [
            (every(), 4),
            (vec![push("a", 2.0), push("b", 2.1), push("c", 5.0)], 3),
        ] {
            assert!(doubt_pushes(&mut pushes, recordings).is_empty());
            assert!(pushes.iter().all(|push| push.confidence > 0.9));
        }
    }
}
