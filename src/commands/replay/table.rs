//! Results of a replay, formatted for a terminal.

use std::fmt::Write as _;

use comfy_table::{CellAlignment, Table, presets};
use tauscope_dynamics::terms::UNKNOWN;
use tauscope_dynamics::terms::words::counted;
use tauscope_pipeline::replay::Outcome;
use tauscope_pipeline::tally::{Event, JointRms};
use tauscope_watch::amount;

/// Formats, for each recording, the counts of the stages, the residuals of the twins and the events.
pub fn table(outcomes: &[Outcome]) -> String {
    let mut text = String::new();
    for outcome in outcomes {
        let _ = writeln!(text, "{} ({:.1} s)", outcome.recording, outcome.duration_s);
        for stage in &outcome.stages {
            let _ = writeln!(
                text,
                "  {:<16} received {:>8}  emitted {:>8}  dropped {:>6}",
                stage.stage, stage.received, stage.emitted, stage.dropped
            );
        }
        for twin in &outcome.twins {
            let moving = 100.0 * twin.moving_samples as f64 / twin.samples.max(1) as f64;
            let _ = writeln!(
                text,
                "  residual of {}, RMS in {} over {} samples, {moving:.0} % of them moving:",
                twin.stage, outcome.effort_unit, twin.samples
            );
            let _ = writeln!(text, "{}", rms_table(outcome, &twin.rms()));
        }
        for detector in &outcome.detectors {
            let (name, events) = (&detector.detector, detector.events.len());
            if detector.judged == 0 {
                let reason = why_nothing_was_judged(outcome, name);
                let _ = writeln!(text, "  {name}: judged no sample: {reason}");
                continue;
            }
            let _ = writeln!(text, "  {name}: {}", counted(events, "event"));
            for event in &detector.events {
                let line = event_line(event, &outcome.effort_unit);
                let _ = writeln!(text, "    {line}");
            }
        }
        for file in &outcome.files {
            let _ = writeln!(text, "  wrote {}", file.display());
        }
        for note in &outcome.notes {
            let _ = writeln!(text, "  warning: {note}");
        }
    }
    text
}

/// Reason why the detector `name` has judged no sample of a recording, as a clause.
fn why_nothing_was_judged(outcome: &Outcome, name: &str) -> String {
    let twins = outcome.twins.iter();
    let Some(twin) = twins
        .max_by_key(|twin| twin.samples)
        .filter(|twin| twin.samples > 0)
    else {
        return "no sample had a measured effort".to_owned();
    };
    if name != tauscope_watch::NAME {
        return format!(
            "the filters had not settled when the recording ended, after {:.1} s",
            outcome.duration_s
        );
    }
    let moves_s = outcome.duration_s * twin.moving_samples as f64 / twin.samples as f64;
    format!(
        "it was still learning. It first learns from `learn_s` of motion ({:.0} s by default); the arm moves for {moves_s:.1} s here",
        tauscope_watch::Config::default().learn_s
    )
}

/// A row of the table: its name, and the value that it shows of a joint.
type Row = (&'static str, fn(&JointRms) -> f64);

fn rms_table(outcome: &Outcome, rms: &[JointRms]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    let names = outcome.joint_names.iter().map(String::as_str);
    table.set_header(std::iter::once("   ").chain(names));
    let rows: [Row; 3] = [
        ("   all samples", |rms| rms.residual_rms),
        ("   moving", |rms| rms.residual_rms_moving),
        ("   low-passed", |rms| rms.filtered_residual_rms),
    ];
    for (name, value) in rows {
        let values = rms.iter().map(value).map(|rms| {
            // NaN where there was no sample of that kind.
            if rms.is_finite() {
                format!("{rms:.3}")
            } else {
                "-".to_owned()
            }
        });
        table.add_row(std::iter::once(name.to_owned()).chain(values));
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn event_line(event: &Event, effort_unit: &str) -> String {
    let mut line = format!("{:8.3} s to {:8.3} s  {}", event.t, event.t_off, event.kind);
    if let Some(size) = event.size.filter(|_| event.kind != UNKNOWN.name) {
        let _ = write!(line, " {}", amount(&event.kind, size, effort_unit));
    }
    if let Some(link) = &event.link {
        let _ = write!(line, " at {link}");
    }
    if let Some(other) = &event.other_link {
        let _ = write!(line, " or {other}");
    }
    if let Some([x, y, z]) = event.force {
        let _ = write!(line, ", {:.1} N", (x * x + y * y + z * z).sqrt());
    }
    if !event.joints.is_empty() {
        let _ = write!(line, " ({})", event.joints.join(", "));
    }
    if event.size.is_some() {
        let _ = write!(line, ", since {:.1} s", event.t_contact);
    }
    line
}

#[cfg(test)]
mod tests {
    use tauscope_bus::{TwinState, flags};
    use tauscope_pipeline::tally::{DetectionTally, TwinTally};

    use super::*;

    /// A recording of 12 s in which one joint moves for three quarters, and no detector judged a sample.
    fn outcome(flags: u32) -> Outcome {
        let mut twin = TwinTally::new("twin", 1);
        for k in 0..4 {
            let mut sample = TwinState::default();
            sample.header.flags = flags;
            sample.velocity[0] = if k == 0 { 0.0 } else { 0.5 };
            twin.add(&sample);
        }
        let detector = |name: &str| {
            let mut detector = DetectionTally::new("detect", &[]);
            name.clone_into(&mut detector.detector);
            detector
        };
        Outcome {
            recording: "push".to_owned(),
            cell: "cell".to_owned(),
            effort_unit: "Nm".to_owned(),
            joint_names: vec!["a".to_owned()],
            duration_s: 12.0,
            stamps_ns: (0, 12_000_000_000),
            lost: 0,
            twins: vec![twin],
            detectors: vec![detector("tauscope"), detector(tauscope_watch::NAME)],
            stages: Vec::new(),
            files: Vec::new(),
            notes: Vec::new(),
        }
    }

    #[test]
    fn the_reason_why_nothing_was_judged_is_that_of_the_recording() {
        let short = table(&[outcome(flags::EFFORT_MEASURED)]);
        for said in [
            "tauscope: judged no sample: the filters had not settled when the recording ended, after 12.0 s",
            "residual_watch: judged no sample: it was still learning. It first learns from `learn_s` of motion (20 s by default); the arm moves for 9.0 s here",
        ] {
            assert!(short.contains(said), "{said}: {short}");
        }
        let bare = table(&[outcome(0)]);
        let reason = "judged no sample: no sample had a measured effort";
        assert_eq!(bare.matches(reason).count(), 2, "{bare}");
    }
}
