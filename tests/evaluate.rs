//! `tauscope evaluate` as a program: its results on the bundled set, its output files, and incomplete sets.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::{Path, PathBuf};

use crate::common::labelled_set::{Set, changed, evaluate};
use crate::common::{bundled, shared, skipped, write};
use serde_json::Value;

const LIGHT: [&str; 2] = ["--detectors", "naive_difference,twin_regression"];

/// Runs `evaluate` with `--json`, which must succeed.
fn summary(set: &Path, out: &Path, more: &[&str]) -> Value {
    let out = evaluate(set, out, &[&["--json"], more].concat());
    assert_eq!(out.code, 0, "{}", out.stderr);
    serde_json::from_str(&out.stdout).unwrap()
}

/// Numbers of a detector's first seed.
fn numbers<'a>(summary: &'a Value, detector: &str) -> &'a Value {
    let all = summary["detectors"].as_array().unwrap();
    &all.iter().find(|d| d["detector"] == detector).unwrap()["seeds"][0]
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn every_contact_of_the_bundled_set_is_found_and_scored() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let set = Set::default().write(folder.path());
    let summary = summary(&set, &out, &LIGHT);
    let twin = numbers(&summary, "twin_regression");
    assert_eq!((&twin["events"], &twin["found"]), (&6.into(), &6.into()));
    assert_eq!(twin["false_alarms"], 0);
    assert!(twin["samples"]["auc"].as_f64().unwrap() > 0.9, "{twin}");
    let naive = numbers(&summary, "naive_difference");
    assert!(naive["samples"]["auc"].as_f64() < twin["samples"]["auc"].as_f64());

    let detections = json(&out.join("demo.twin_regression.json"));
    assert_eq!(detections["recording"], "demo");
    assert_eq!(detections["detector"], "twin_regression");
    assert_eq!(detections["scores"], "demo.twin_regression.csv");
    let first = &detections["events"][0];
    assert!((first["t"].as_f64().unwrap() - 3.3).abs() < 0.15, "{first}");
    assert!(first["t_contact"].as_f64() <= first["t"].as_f64());
    assert_eq!(first["force"].as_array().unwrap().len(), 3);
    let scores = std::fs::read_to_string(out.join("demo.twin_regression.csv")).unwrap();
    assert!(scores.starts_with("t,score\n0,"), "{}", &scores[..30]);
    assert_eq!(scores.lines().count(), 1 + 3001);
    assert!(out.join("demo_validation.twin_regression.json").is_file());
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("<svg") && !page.contains("<script") && !page.contains("://"));
    assert!(out.join("results.parquet").is_file() && out.join("events.parquet").is_file());

    let again = [
        "evaluate",
        set.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ];
    let again = crate::common::Out::answer(again.iter().chain(&LIGHT));
    assert_eq!(again.code, 2, "{again:?}");
    assert!(again.stderr.contains("--force"), "{again:?}");
    assert_eq!(
        std::fs::read_to_string(out.join("report.html")).unwrap(),
        page
    );
}

#[test]
fn the_files_are_the_same_whatever_the_number_of_jobs() {
    let folder = tempfile::tempdir().unwrap();
    let set = Set::default().write(folder.path());
    let files = ["1", "4"].map(|jobs| {
        let out = folder.path().join(jobs);
        summary(&set, &out, &[&LIGHT[..], &["--jobs", jobs]].concat());
        ["json", "csv"].map(|ending| {
            std::fs::read(out.join(format!("demo.naive_difference.{ending}"))).unwrap()
        })
    });
    assert_eq!(files[0], files[1]);
}

#[test]
fn further_twins_stand_beside_the_first_and_cannot_be_mistaken_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let set = Set::default().write(folder.path());
    let file = bundled().join("demo.twin.yaml");
    let twins = ["--twin", "regression", "--twin", "rigid", "--twin"];
    let more = [&LIGHT[..], &twins, &[file.to_str().unwrap()]].concat();
    let summary = summary(&set, &out, &more);
    let twins: Vec<&Value> = (summary["detectors"].as_array().unwrap().iter())
        .map(|detector| &detector["twin"])
        .collect();
    let name = ["regression", "rigid", "demo.twin"];
    assert_eq!(
        twins,
        [name[0], name[0], name[1], name[1], name[2], name[2]]
    );
    assert_eq!(
        json(&out.join("demo.twin_regression.json"))["twin"],
        "regression"
    );
    let further = json(&out.join("rigid/demo.twin_regression.json"));
    assert_eq!(further["detector"], "twin_regression@rigid");
}

#[test]
fn the_usual_twin_is_a_regression_and_of_an_arm_under_impedance_control_the_rigid_one() {
    let impedance = "impedance: {translational_n_per_m: 150, rotational_nm_per_rad: 10}";
    for (more, wanted) in [("", "regression"), (impedance, "rigid")] {
        let folder = tempfile::tempdir().unwrap();
        let set = Set {
            more,
            ..Set::default()
        };
        let set = set.write(folder.path());
        let summary = summary(&set, &folder.path().join("out"), &LIGHT);
        assert_eq!(summary["detectors"][0]["twin"], wanted);
    }
}

#[test]
fn without_labels_there_are_detections_and_it_is_said_that_nothing_was_scored() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let text = r#"{"set": "hands", "recordings": {"demo_validation": {"events": []}}}"#;
    write(&folder.path().join("labels_train.json"), text);
    let set = Set {
        labels: None,
        ..Set::default()
    };
    let run = evaluate(&set.write(folder.path()), &out, &LIGHT);
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(run.stdout.contains("nothing was scored"), "{}", run.stdout);
    let detections = json(&out.join("demo.twin_regression.json"));
    assert!(detections["events"].as_array().unwrap().len() >= 6);
}

#[test]
fn without_a_file_of_labels_the_contact_topic_tells() {
    let folder = tempfile::tempdir().unwrap();
    let set = Set {
        labels: None,
        ..Set::default()
    };
    let set = set.write(folder.path());
    let summary = summary(&set, &folder.path().join("out"), &LIGHT);
    let twin = numbers(&summary, "twin_regression");
    assert_eq!((&twin["events"], &twin["found"]), (&6.into(), &6.into()));
    assert_eq!(twin["links"], 0, "the topic knows no link");
}

#[test]
fn a_set_with_no_contact_has_no_auc_but_false_alarms() {
    let folder = tempfile::tempdir().unwrap();
    let quiet = changed(folder.path(), "demo_train_points.mcap", |_, _| true);
    std::fs::rename(&quiet, folder.path().join("quiet.mcap")).unwrap();
    let labels = r#"{"set": "hands", "recordings": {"quiet": {"events": []}}}"#;
    let set = Set {
        labels: Some(write(&folder.path().join("own.json"), labels)),
        test: folder.path().join("quiet.mcap"),
        ..Set::default()
    };
    let set = set.write(folder.path());
    let summary = summary(&set, &folder.path().join("out"), &LIGHT);
    let twin = numbers(&summary, "twin_regression");
    assert_eq!(twin["samples"]["auc"], Value::Null);
    assert_eq!(twin["samples"]["f1"], Value::Null);
    assert!(twin["false_alarms_per_hour"].is_number(), "{twin}");
}

#[test]
fn a_burst_of_nan_is_counted_and_a_gap_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let burst = changed(folder.path(), "demo.mcap", |row, state| {
        if (1000..1040).contains(&row) {
            state.effort[2] = f64::NAN;
        }
        !(2000..2100).contains(&row)
    });
    let set = Set {
        test: burst,
        ..Set::default()
    };
    let out = evaluate(
        &set.write(folder.path()),
        &folder.path().join("out"),
        &LIGHT,
    );
    assert_eq!(out.code, 3, "{}", out.stderr);
    assert!(out.stdout.contains("in 40 messages"), "{}", out.stdout);
    assert!(
        out.stdout.contains("demo: 2 gaps in time"),
        "{}",
        out.stdout
    );
}

#[test]
fn what_is_wrong_with_the_arguments_or_the_set_is_said_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let set = Set {
        test: PathBuf::from("nowhere.mcap"),
        ..Set::default()
    };
    let set = set.write(folder.path());
    let more = ["--detectors", "twin_regresion", "--twin", "topic"];
    let run = evaluate(&set, &out, &more);
    assert_eq!(run.code, 2);
    for said in [
        "nowhere.mcap",
        "did you mean `twin_regression`?",
        "topics.twin",
    ] {
        assert!(run.stderr.contains(said), "{said}: {}", run.stderr);
    }
    assert!(!out.exists(), "nothing was started");
}

#[test]
fn labels_of_a_set_that_are_none_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"{"recordings": {"demo": {"events": [{"t_on": 2.0, "t_off": 1.0}]}}}"#;
    let set = Set {
        labels: Some(write(&folder.path().join("own.json"), text)),
        ..Set::default()
    };
    let run = evaluate(
        &set.write(folder.path()),
        &folder.path().join("out"),
        &LIGHT,
    );
    assert_eq!(run.code, 2);
    assert!(
        run.stderr.contains("an event from 2 s to 1 s"),
        "{}",
        run.stderr
    );
}

/// Comparison on a part of the practice set with the scorer of this set, if Python and numpy are installed.
#[test]
fn the_scorer_of_the_practice_sets_says_the_same() {
    const TEST: &str = "the_scorer_of_the_practice_sets_says_the_same";
    let Some(shared) = shared(TEST) else { return };
    let paths = shared.join("contacts/paths");
    let Ok(paths) = paths.canonicalize() else {
        return skipped(TEST, "../shared/contacts/paths is absent");
    };
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let recordings = |range: std::ops::Range<usize>| {
        let each = range.map(|i| format!("{}/recordings/rec_{i:03}.mcap", paths.display()));
        each.collect::<Vec<_>>().join(", ")
    };
    // The scorer counts missing recordings as missed contacts, so only the labels of the used ones are given.
    let mut labels = json(&paths.join("labels.json"));
    let all = labels["recordings"].as_object_mut().unwrap();
    all.retain(|name, _| ["rec_030", "rec_031", "rec_035", "rec_036"].contains(&name.as_str()));
    let labels = write(&folder.path().join("labels.json"), &labels.to_string());
    let text = format!(
        "set: paths\nrobot: {}/xarm7_like.urdf\nlabels: {}\ntrain: [{}]\nvalidation: [{}]\ntest: [{}]\n",
        paths.display(),
        labels.display(),
        recordings(0..6),
        recordings(30..32),
        recordings(35..37),
    );
    let set = write(&folder.path().join("set.yaml"), &text);
    let summary = summary(&set, &out, &LIGHT);
    let twin = numbers(&summary, "twin_regression");
    let auc = twin["samples"]["auc"].as_f64().unwrap();
    assert!(auc > 0.8, "{twin}");

    let mut scorer = std::process::Command::new("python3");
    scorer
        .arg(shared.join("contacts/score.py"))
        .arg(&labels)
        .arg(&out);
    let Ok(output) = scorer.output() else {
        return skipped(TEST, "the scorer needs python3");
    };
    let said = String::from_utf8_lossy(&output.stdout);
    let row = said
        .lines()
        .find(|line| line.trim().starts_with("twin_regression"));
    let Some(row) = row else {
        return skipped(TEST, "the scorer needs numpy");
    };
    let samples = &twin["samples"];
    let three = |value: &Value| format!("{:.3}", value.as_f64().unwrap());
    let found = format!(" {} (", twin["found"]);
    for ours in [
        three(&samples["f1"]),
        three(&samples["best_f1"]),
        three(&samples["auc"]),
        found,
    ] {
        assert!(row.contains(&ours), "{ours} is not in: {row}");
    }
}
