//! `tauscope calibrate` on several recordings.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::collections::BTreeMap;

use crate::common::{Out, bundled, tauscope};
use tauscope_twin::TwinFile;

/// By detector, samples and mean of its score on bundled recordings, in this order.
fn scores(recordings: [&str; 2]) -> BTreeMap<String, (u64, f64)> {
    let folder = tempfile::tempdir().unwrap();
    let twin = folder.path().join("twin.yaml");
    let mut calibrate = tauscope();
    calibrate
        .args(["calibrate", "--robot"])
        .arg(bundled().join("demo_arm.urdf"))
        .args(recordings.map(|name| bundled().join(name)))
        .arg("--out")
        .arg(&twin);
    let out = Out::of(calibrate);
    assert_eq!(out.code, 0, "{}", out.stderr);
    let file: TwinFile = serde_saphyr::from_str(&std::fs::read_to_string(twin).unwrap()).unwrap();
    let of = |(name, score): (String, tauscope_twin::ScoreStatistics)| {
        (name, (score.samples, score.mean))
    };
    file.scores.into_iter().map(of).collect()
}

#[test]
fn a_detector_begins_anew_with_each_recording_whichever_was_recorded_first() {
    let forth = scores(["demo_train_points.mcap", "demo_train_sweep.mcap"]);
    let back = scores(["demo_train_sweep.mcap", "demo_train_points.mcap"]);
    assert_eq!(forth.len(), 3);
    for (detector, (samples, mean)) in &forth {
        let (other_samples, other_mean) = back[detector];
        assert_eq!(*samples, other_samples, "{detector}");
        assert!(
            (mean / other_mean - 1.0).abs() < 1e-6,
            "{detector}: {mean} and {other_mean}"
        );
    }
}

#[test]
fn a_joints_low_pass_is_chosen_unless_one_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let cutoffs = |given: &[&str]| {
        let twin = folder.path().join("twin.yaml");
        let mut calibrate = tauscope();
        calibrate
            .args(["calibrate", "--force", "--robot"])
            .arg(bundled().join("demo_arm.urdf"))
            .arg(bundled().join("demo_train_sweep.mcap"))
            .args(given)
            .arg("--out")
            .arg(&twin);
        let out = Out::of(calibrate);
        assert_eq!(out.code, 0, "{}", out.stderr);
        let text = std::fs::read_to_string(twin).unwrap();
        let file: TwinFile = serde_saphyr::from_str(&text).unwrap();
        let own: Vec<f64> = (file.joints.values())
            .filter_map(|joint| joint.effort_cutoff_hz)
            .collect();
        (file.filters.effort_cutoff_hz, own)
    };
    let (usual, chosen) = cutoffs(&[]);
    assert!((usual - 4.5).abs() < 1e-9 && !chosen.is_empty());
    assert!(
        chosen.iter().all(|hz| (6.0..51.0).contains(hz)),
        "{chosen:?}"
    );
    assert_eq!(cutoffs(&["--effort-cutoff-hz", "8"]), (8.0, Vec::new()));
}
