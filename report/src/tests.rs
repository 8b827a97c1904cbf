use serde_json::json;

use super::*;
use tauscope_explain::report::{
    Finding, JointPicture, Located, NextMotion, Rejected, Rival, Undetectable,
};

fn empty(verdict: Verdict) -> Report {
    Report {
        case: "cell 4".to_owned(),
        verdict,
        reason: None,
        summary: "The summary.".to_owned(),
        effort_unit: "Nm".to_owned(),
        findings: Vec::new(),
        rejected: Vec::new(),
        located: Vec::new(),
        undetectable: Vec::new(),
        next_motions: Vec::new(),
        notes: Vec::new(),
        joints: vec!["joint1".to_owned(), "joint2".to_owned()],
        sliding_joints: Vec::new(),
        holdout_rms_before: vec![1.0, 0.1],
        holdout_rms_after: vec![0.11, 0.1],
        remaining: Vec::new(),
        noise_floor: vec![0.1, 0.1],
        holdout_predictions: BTreeMap::new(),
        simulated: None,
    }
}

pub fn finding(effect: &str, sentence: &str) -> Finding {
    Finding {
        effect: effect.to_owned(),
        joint: Some("joint1".to_owned()),
        parameters: [("coulomb_nm".to_owned(), 4.1.into())].into(),
        intervals_95: [("coulomb_nm".to_owned(), [3.9, 4.3])].into(),
        confidence: 0.999,
        explains: 0.63,
        evidence_nats: 40.0,
        effort_rms: 2.0,
        sentence: sentence.to_owned(),
        ..Finding::default()
    }
}

fn full() -> Report {
    let mut report = empty(Verdict::Explained);
    report.findings = vec![
        finding("coulomb_friction", "The first sentence."),
        finding("some_new_effect", "The second sentence."),
    ];
    report.findings[1].equivalent_to = vec![Rival {
        effect: "torque_gain".to_owned(),
        joint: Some("joint2".to_owned()),
        link: None,
    }];
    report.findings[1].recording = Some("rec_01".to_owned());
    report.findings[1].t_start = Some(0.5);
    report.rejected = vec![Rejected {
        effect: "backlash".to_owned(),
        joint: None,
        link: Some("tool".to_owned()),
        reason: "Why it was not.".to_owned(),
    }];
    report.located = vec![Located {
        joint: "joint1".to_owned(),
        place: "at reversals".to_owned(),
        share_of_residual: 0.7,
        over_noise: 12.0,
    }];
    report.undetectable = vec![Undetectable {
        effect: "rotor_inertia".to_owned(),
        joint: Some("joint2".to_owned()),
        link: None,
        smallest_findable: [("inertia_kgm2".to_owned(), 0.021)].into(),
        in_amperes: false,
        slides: false,
    }];
    report.next_motions = vec![NextMotion {
        separates: report.findings[1].equivalent_to.clone(),
        sentence: "Move slowly.".to_owned(),
        trajectory: Some("next_1.csv".to_owned()),
    }];
    report.notes = vec!["A note.".to_owned()];
    report
}

fn picture(fill: impl Fn(usize) -> f64) -> RecordingPicture {
    let series = || (0..50).map(&fill).collect::<Vec<_>>();
    let joint = |name: &str| JointPicture {
        joint: name.to_owned(),
        time_s: (0..50).map(|i| f64::from(i) * 0.1).collect(),
        position: series(),
        velocity: series(),
        measured: series(),
        before: series(),
        after: series(),
    };
    RecordingPicture {
        recording: "rec_01".to_owned(),
        held_out: true,
        start_ns: 5,
        joints: vec![joint("joint1"), joint("joint2")],
    }
}

fn around() -> Around<'static> {
    Around {
        provenance: [("made by".to_owned(), "tauscope 0.1.0".to_owned())].into(),
        date: "2026-11-23".to_owned(),
        robot: Some("arm.urdf".to_owned()),
        fit: vec!["rec_00.mcap".to_owned()],
        twin: Some("report/twin.yaml".to_owned()),
        ..Around::default()
    }
}

/// Every element that is opened is closed, in order.
fn assert_well_formed(page: &str) {
    let without_style = {
        let (head, rest) = page.split_once("<style>").expect("a style");
        let (_, tail) = rest.split_once("</style>").expect("its end");
        format!("{head}{tail}")
    };
    let mut open = Vec::new();
    for tag in without_style.split('<').skip(1) {
        let (tag, text) = tag.split_once('>').expect("tags are closed");
        assert!(!text.contains('>'), "unescaped > in {text}");
        let name = tag.split(' ').next().unwrap_or_default();
        match name.strip_prefix('/') {
            Some(name) => assert_eq!(open.pop(), Some(name), "in {tag}"),
            None if matches!(name, "!DOCTYPE" | "meta") => {}
            None => open.push(name),
        }
    }
    assert!(open.is_empty(), "{open:?} stay open");
}

#[test]
fn all_that_was_found_is_on_the_page() {
    let report = full();
    let wavy = picture(|i| (i as f64).sin());
    let page = page(&report, &[wavy], &around());
    assert_well_formed(&page);
    let texts = [
        "The summary.",
        "The first sentence.",
        "The second sentence.",
        "Coulomb friction",
        "Some new effect",
        "4.10",
        "N m",
        "3.90 to 4.30",
        "Torque gain, joint2",
        "Cannot be distinguished",
        "at reversals",
        "12 × noise",
        "Why it was not.",
        "Backlash",
        "0.0210",
        "Rotor inertia",
        "Move slowly.",
        "href=\"next_1.csv\"",
        "A note.",
        "tauscope 0.1.0",
        "rec_01",
        "−89 %",
        "&gt; 99 %",
    ];
    for text in texts {
        assert!(page.contains(text), "{text} is missing");
    }
}

#[test]
fn it_needs_nothing_from_elsewhere() {
    let page = page(&full(), &[picture(|i| i as f64)], &around());
    for word in [
        "http:", "https:", "src=", "url(", "@import", "<script", "<link",
    ] {
        assert!(!page.contains(word), "{word}");
    }
    assert!(page.contains("default-src 'none'"));
}

#[test]
fn text_is_escaped() {
    let nasty = "<script>alert(\"x\")</script>&amp;";
    let mut report = full();
    report.case = nasty.to_owned();
    report.summary = nasty.to_owned();
    report.reason = Some(format!("reason {nasty}"));
    report.joints[0] = nasty.to_owned();
    report.notes.push(nasty.to_owned());
    report.effort_unit = nasty.to_owned();
    for finding in &mut report.findings {
        finding.joint = Some(nasty.to_owned());
        finding.sentence = nasty.to_owned();
        finding.effect = nasty.to_owned();
        finding.recording = Some(nasty.to_owned());
        finding.parameters = [(nasty.to_owned(), json!(nasty))].into();
    }
    report.rejected[0].reason = nasty.to_owned();
    report.located[0].place = nasty.to_owned();
    report.next_motions[0].trajectory = Some("javascript:alert(1)".to_owned());
    let mut drawn = picture(|i| i as f64);
    drawn.recording = nasty.to_owned();
    drawn.joints[0].joint = nasty.to_owned();
    let around = Around {
        provenance: [(nasty.to_owned(), nasty.to_owned())].into(),
        date: nasty.to_owned(),
        robot: Some(nasty.to_owned()),
        start: Some(nasty.to_owned()),
        fit: vec![nasty.to_owned()],
        holdout: vec![nasty.to_owned()],
        twin: Some(nasty.to_owned()),
        corrected_robot: Some(nasty.to_owned()),
        model: None,
        rollout: None,
    };
    let page = page(&report, &[drawn], &around);
    assert_well_formed(&page);
    assert!(!page.contains("<script"));
    assert!(!page.contains("href=\"javascript"));
    assert!(page.contains("&lt;script&gt;alert(&quot;x&quot;)"));
}

#[test]
fn every_verdict_makes_a_page() {
    for (verdict, text) in [
        (Verdict::Explained, "Explained"),
        (Verdict::NothingMissing, "Nothing missing"),
        (Verdict::UnknownRemains, "Something unknown remains"),
        (Verdict::NotEvaluated, "Not evaluated"),
    ] {
        let page = page(&empty(verdict), &[], &Around::default());
        assert_well_formed(&page);
        assert!(page.contains(text) && page.contains("The summary."));
    }
    let mut report = empty(Verdict::NotEvaluated);
    report.reason = Some("The joints stand still.".to_owned());
    report.joints.clear();
    report.holdout_rms_before.clear();
    report.holdout_rms_after.clear();
    report.noise_floor.clear();
    let page = page(&report, &[], &around());
    assert_well_formed(&page);
    assert!(page.contains("Why: The joints stand still."));
}

#[test]
fn what_is_left_is_said_whatever_the_verdict() {
    let mut report = empty(Verdict::NothingMissing);
    report.holdout_rms_after = vec![0.1, 2.0];
    let page = page(&report, &[], &around());
    assert!(page.contains("joint2 at 20 × its noise"));
    assert!(page.contains("Nothing was named."));
    assert!(!page.contains("is noise, as far as this data shows"));
}

#[test]
fn what_is_no_number_does_not_show() {
    let nan = f64::NAN;
    let mut report = full();
    report.holdout_rms_before = vec![nan, f64::INFINITY];
    report.holdout_rms_after = vec![nan];
    report.noise_floor = vec![0.0, nan];
    report.findings[0].parameters = [("coulomb_nm".to_owned(), json!(nan))].into();
    report.findings[0].intervals_95 = [("coulomb_nm".to_owned(), [nan, nan])].into();
    report.findings[0].explains = nan;
    report.findings[0].confidence = nan;
    report.located[0].share_of_residual = nan;
    report.located[0].over_noise = nan;
    report.undetectable[0].smallest_findable = [("inertia_kgm2".to_owned(), nan)].into();
    let gaps = picture(|i| if i % 7 == 0 { nan } else { i as f64 });
    for pictures in [vec![gaps], vec![picture(|_| nan)], vec![picture(|_| 0.0)]] {
        let page = page(&report, &pictures, &Around::default());
        assert_well_formed(&page);
        assert!(!page.contains("NaN") && !page.contains("inf "));
    }
}

#[test]
fn numbers_of_a_joint_without_a_scale_are_in_amperes() {
    let mut report = full();
    report.findings.truncate(1);
    assert!(page(&report, &[], &Around::default()).contains("</b> N m"));
    report.findings[0].in_amperes = true;
    let page = page(&report, &[], &Around::default());
    assert!(page.contains("</b> A") && !page.contains("</b> N m"));
}

#[test]
fn the_box_says_what_to_load_what_to_look_at_and_what_to_record() {
    let mut report = full();
    report.findings[0].parameters.clear();
    let page = page(&report, &[], &around());
    let (_, todo) = page.split_once("id=\"now\"").unwrap_or_default();
    let (todo, _) = todo.split_once("</section>").unwrap_or_default();
    for text in [
        "twin: {model: report/twin.yaml}",
        "It leaves 15 % of the error",
        "Joint joint1: does its brake drag",
        "Move slowly.",
        "href=\"next_1.csv\"",
        "2026-11-23",
        "arm.urdf",
        "rec_00.mcap",
    ] {
        assert!(todo.contains(text), "{text} is missing in {todo}");
    }
    report.holdout_rms_after = report.holdout_rms_before.clone();
    let page = super::page(&report, &[], &around());
    assert!(page.contains("Nothing yet. On recordings that were not fitted"));
    assert!(!page.contains("twin: {model:"));
    let none = empty(Verdict::NotEvaluated);
    assert!(
        super::page(&none, &[], &around())
            .contains("There is no corrected twin without a verdict.")
    );
}

#[test]
fn the_place_with_the_largest_effort_comes_first_whatever_explains_most() {
    let mut report = full();
    report.findings[0].effort_rms = 0.27;
    report.findings[1].joint = Some("joint2".to_owned());
    report.findings[1].effort_rms = 12.7;
    report.findings[1].explains = 0.02;
    let page = page(&report, &[], &Around::default());
    let at = |text: &str| page.find(text).unwrap_or(usize::MAX);
    assert!(at("up to 12.7 N m") < at("up to 0.270 N m"));
    assert!(at("The second sentence.") < at("The first sentence."));
}

#[test]
fn the_verdicts_colour_follows_the_share_that_has_no_name() {
    let mut report = full();
    report.verdict = Verdict::UnknownRemains;
    report.findings[1].effect = "unknown".to_owned();
    for (explains, left, class, text) in [
        (0.0, 0.1, "explained", "Something unknown remains: "),
        (0.05, 0.1, "nothing", "remains: 22 % of the error (RMS)"),
        (0.4, 0.1, "remains", "remains: 63 % of the error (RMS)"),
        (0.0, 0.8, "remains", "remains: 79 % of the error (RMS)"),
    ] {
        report.findings[1].explains = explains;
        report.holdout_rms_after = vec![left, 0.1];
        let page = page(&report, &[], &Around::default());
        assert!(page.contains(&format!("verdict {class}")), "{class}");
        assert!(page.contains(text), "{text}");
        assert!(page.contains(": Something unknown remains</title>"));
        assert!(!page.contains("Explained but"));
    }
}

#[test]
fn no_sentence_contradicts_another() {
    let mut report = full();
    // Below the noise as it is estimated.
    report.holdout_rms_after = vec![0.05, 0.1];
    report.findings[0].sentence =
        "On recordings that were not fitted the error falls to 11 %.".to_owned();
    let page = page(&report, &[], &Around::default());
    assert!(!page.contains("no model can do better"));
    assert!(page.contains("Below the estimated noise: joint1."));
    // One measure of what is left: the root mean square.
    assert!(!page.contains("squared error"));
    assert!(page.contains("<dt>11 %</dt>"), "{page}");
    // A joint in A has no N m, and its limits neither.
    report.findings.truncate(1);
    report.findings[0].in_amperes = true;
    report.effort_unit = "A".to_owned();
    report.undetectable[0].smallest_findable = [("coulomb_nm".to_owned(), 0.02)].into();
    report.undetectable[0].in_amperes = true;
    assert!(!super::page(&report, &[], &Around::default()).contains("N m"));
}

#[test]
fn the_robot_is_drawn_with_what_was_found() {
    let urdf = include_str!("../../tests/data/demo_arm.urdf");
    let Ok(model) = Model::from_urdf(urdf) else {
        panic!("the bundled arm");
    };
    let mut report = full();
    report.joints = model.joint_names().map(str::to_owned).collect();
    let around = Around {
        model: Some(&model),
        ..Around::default()
    };
    let page = page(&report, &[], &around);
    assert_well_formed(&page);
    assert_eq!(page.matches("<circle class=\"joint\"").count(), 6);
    assert_eq!(page.matches("<circle class=\"joint found\"").count(), 1);
    assert!(page.contains("joint1 · 2.00 N m"));
}
