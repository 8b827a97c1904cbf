//! `results.parquet` and `events.parquet`, as flat tables that any SQL tool reads.

use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, StringArray};
use tauscope_pipeline::tables::{TableError, floats, integers, write_table};
use tauscope_pipeline::tally::Event;

use crate::evaluation::Evaluation;
use crate::judged::Judged;
use crate::metrics::numbers::{SampleNumbers, force_error_deg};
use crate::metrics::{Matched, Numbers, Scored};
use crate::recording::Role;
use crate::runner::{Output, Runner};

/// A table that grows row by row. Each row passes the same column names.
#[derive(Default)]
struct Rows {
    texts: Vec<(&'static str, Vec<Option<String>>)>,
    counts: Vec<(&'static str, Vec<u64>)>,
    numbers: Vec<(&'static str, Vec<f64>)>,
}

fn push<T>(columns: &mut Vec<(&'static str, Vec<T>)>, name: &'static str, value: T) {
    match columns.iter_mut().find(|(other, _)| *other == name) {
        Some((_, column)) => column.push(value),
        None => columns.push((name, vec![value])),
    }
}

impl Rows {
    fn text(&mut self, name: &'static str, value: Option<&str>) {
        push(&mut self.texts, name, value.map(str::to_owned));
    }

    fn count(&mut self, name: &'static str, value: usize) {
        push(&mut self.counts, name, value as u64);
    }

    fn number(&mut self, name: &'static str, value: f64) {
        push(&mut self.numbers, name, value);
    }

    fn clear(&mut self) {
        self.texts.iter_mut().for_each(|(_, column)| column.clear());
        self.counts
            .iter_mut()
            .for_each(|(_, column)| column.clear());
        self.numbers
            .iter_mut()
            .for_each(|(_, column)| column.clear());
    }

    fn write(self, path: &Path) -> Result<(), TableError> {
        let texts = self.texts.into_iter().map(|(name, column)| {
            let column: ArrayRef = Arc::new(StringArray::from(column));
            (name, column)
        });
        let counts = self.counts.into_iter().map(|(n, c)| (n, integers(c)));
        let numbers = self.numbers.into_iter().map(|(n, c)| (n, floats(c)));
        write_table(path, texts.chain(counts).chain(numbers))
    }
}

/// Writes a row per twin, detector, seed and recording, and one over all test recordings, whose `recording` is null.
/// Figures that need labels are NaN without them.
pub fn write_results(path: &Path, evaluation: &Evaluation) -> Result<(), TableError> {
    let mut rows = Rows::default();
    for run in &evaluation.runs {
        let twin = &evaluation.twins[run.twin].name;
        for runner in &run.seeds {
            let mut all = Vec::new();
            for output in &runner.outputs {
                let scored = Scored::of(&evaluation.request, output, runner.window());
                head(&mut rows, evaluation, twin, runner, Some(output));
                let one: Vec<&Scored<'_>> = scored.iter().collect();
                numbers(&mut rows, &Numbers::of(&evaluation.request, runner, &one));
                all.extend(scored.filter(|_| output.role == Role::Test));
            }
            head(&mut rows, evaluation, twin, runner, None);
            let all: Vec<&Scored<'_>> = all.iter().collect();
            numbers(&mut rows, &Numbers::of(&evaluation.request, runner, &all));
        }
    }
    rows.write(path)
}

fn head(
    rows: &mut Rows,
    evaluation: &Evaluation,
    twin: &str,
    runner: &Runner,
    output: Option<&Output>,
) {
    let outputs = || {
        let test = |one: &&Output| one.role == Role::Test;
        runner.outputs.iter().filter(test)
    };
    rows.text("set", Some(&evaluation.request.set.set));
    rows.text("twin", Some(twin));
    rows.text("detector", Some(runner.entry.name));
    rows.text("recording", output.map(|output| output.recording.as_str()));
    rows.text("role", Some(output.map_or(Role::Test, |o| o.role).as_str()));
    rows.count("seed", runner.seed as usize);
    let all = || outputs().map(|output| output.events.len()).sum();
    rows.count("detections", output.map_or_else(all, |o| o.events.len()));
    rows.number("threshold", runner.threshold);
    rows.number("validation_score_mean", runner.statistics.mean);
    rows.number("validation_score_sd", runner.statistics.standard_deviation);
    rows.number("training_s", runner.training_s);
    let all = || outputs().map(|output| output.took_s).sum();
    rows.number("test_s", output.map_or_else(all, |o| o.took_s));
}

fn numbers(rows: &mut Rows, numbers: &Numbers) {
    let samples = &numbers.samples;
    rows.count("samples", samples.count);
    rows.count("events", numbers.events);
    rows.count("found", numbers.found);
    rows.count("false_alarms", numbers.false_alarms);
    rows.count("strict_false_alarms", numbers.strict_false_alarms);
    rows.count("links", numbers.links);
    rows.count("link_exact", numbers.link_exact);
    rows.count("link_within_one", numbers.link_within_one);
    rows.count("link_alone", numbers.link_alone);
    rows.count("link_alone_exact", numbers.link_alone_exact);
    rows.count("link_told", numbers.link_told);
    rows.number("contact_share", samples.contact_share);
    rows.number("f1", samples.f1);
    rows.number("best_f1", samples.best_f1);
    rows.number("best_sigmas", samples.best_sigmas);
    rows.number("auc", samples.auc);
    let window = |of: fn(&SampleNumbers) -> f64| numbers.windows.as_ref().map_or(f64::NAN, of);
    rows.number("window_f1", window(|w| w.f1));
    rows.number("window_best_f1", window(|w| w.best_f1));
    rows.number("window_best_sigmas", window(|w| w.best_sigmas));
    rows.number("window_auc", window(|w| w.auc));
    rows.number("false_alarms_per_hour", numbers.false_alarms_per_hour);
    rows.number(
        "false_alarms_per_hour_bound",
        numbers.false_alarms_per_hour_bound,
    );
    let strict_per_hour = numbers.strict_false_alarms_per_hour;
    rows.number("strict_false_alarms_per_hour", strict_per_hour);
    rows.number("free_hours", numbers.free_hours);
    rows.number("free_share_in_alarm", numbers.free_share_in_alarm);
    rows.number("delay_mean_s", numbers.delay_s.mean);
    rows.number("delay_sd_s", numbers.delay_s.sd);
    rows.number("delay_p50_s", numbers.delay_s.p50);
    rows.number("delay_p90_s", numbers.delay_s.p90);
    rows.number("delay_p99_s", numbers.delay_s.p99);
    rows.number("force_error_p50_deg", numbers.force_error_deg.p50);
}

/// Writes a row per true event of a test recording, and one per false alarm, whose `t_on_s` is NaN.
pub fn write_events(path: &Path, judged: &[Judged<'_>]) -> Result<(), TableError> {
    let mut rows = Rows::default();
    // Creates the columns even if no row follows.
    event(&mut rows, "", "", None, None);
    rows.clear();
    for judged in judged {
        let label = &judged.label;
        for one in &judged.scored {
            let recording = &one.output.recording;
            for matched in &one.matching.events {
                event(
                    &mut rows,
                    label,
                    recording,
                    Some(matched),
                    matched.detection,
                );
            }
            for alarm in &one.matching.false_alarms {
                event(&mut rows, label, recording, None, Some(alarm));
            }
        }
    }
    rows.write(path)
}

fn event(
    rows: &mut Rows,
    detector: &str,
    recording: &str,
    matched: Option<&Matched<'_>>,
    said: Option<&Event>,
) {
    let truly = matched.map(|matched| matched.event);
    rows.text("detector", Some(detector));
    rows.text("recording", Some(recording));
    rows.text("kind", truly.map(|event| event.kind.as_str()));
    rows.text("link", truly.and_then(|event| event.link.as_deref()));
    rows.text(
        "operator",
        truly.and_then(|event| event.operator.as_deref()),
    );
    rows.text("during", truly.and_then(|event| event.during.as_deref()));
    rows.text(
        "material",
        truly.and_then(|event| event.material.as_deref()),
    );
    rows.text("told_kind", said.map(|event| event.kind.as_str()));
    rows.text("told_link", said.and_then(|event| event.link.as_deref()));
    let other = said.and_then(|event| event.other_link.as_deref());
    rows.text("told_other_link", other);
    let joints = said.map(|event| event.joints.join(" "));
    rows.text("told_joints", joints.as_deref());
    let length = |force: [f64; 3]| force.iter().map(|f| f * f).sum::<f64>().sqrt();
    let force = |force: Option<[f64; 3]>| force.map_or(f64::NAN, length);
    rows.number("t_on_s", truly.map_or(f64::NAN, |event| event.t_on));
    rows.number("t_off_s", truly.map_or(f64::NAN, |event| event.t_off));
    rows.number("force_n", force(truly.and_then(|event| event.force)));
    rows.number("told_t_s", said.map_or(f64::NAN, |event| event.t));
    rows.number("told_t_off_s", said.map_or(f64::NAN, |event| event.t_off));
    rows.number(
        "told_t_contact_s",
        said.map_or(f64::NAN, |event| event.t_contact),
    );
    rows.number("told_force_n", force(said.and_then(|event| event.force)));
    let delay = matched.and_then(Matched::delay_s);
    rows.number("delay_s", delay.unwrap_or(f64::NAN));
    let angle = matched.and_then(force_error_deg);
    rows.number("force_error_deg", angle.unwrap_or(f64::NAN));
}
