//! Results of an explanation, formatted for a terminal.

use std::collections::BTreeMap;

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};
use serde_json::Value;
use tauscope_dynamics::terms;
use tauscope_explain::report::{Finding, Report, Rival};

use super::output::Made;

/// Formats the verdict, the findings, the errors on held-out recordings, and the paths of the files.
pub fn text(report: &Report, made: &Made) -> String {
    let mut parts = vec![format!("{}: {}", report.case, report.summary)];
    if !report.findings.is_empty() {
        parts.push(findings(report).to_string());
    }
    if report.holdout_rms_before.iter().any(|rms| rms.is_finite()) {
        parts.push(proof(report).to_string());
    }
    let notes = report.notes.iter().chain(&made.notes);
    let notes: Vec<String> = notes.map(|note| format!("note: {note}")).collect();
    if !notes.is_empty() {
        parts.push(notes.join("\n"));
    }
    let motions = report.grouped_motions().into_iter();
    let motions = motions.map(|(sentence, motions)| {
        let files = motions.iter().filter_map(|it| it.trajectory.as_deref());
        let files: Vec<&str> = files.collect();
        if files.is_empty() {
            format!("next: {sentence}")
        } else {
            format!("next: {sentence} ({})", files.join(", "))
        }
    });
    let motions: Vec<String> = motions.collect();
    if !motions.is_empty() {
        parts.push(motions.join("\n"));
    }
    let files: Vec<String> = made
        .files
        .iter()
        .map(|file| file.display().to_string())
        .collect();
    parts.push(format!("wrote {}", files.join(", ")));
    parts.join("\n\n")
}

fn findings(report: &Report) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_content_arrangement(ContentArrangement::Dynamic);
    table.set_header([
        "effect",
        "where",
        "parameters (95 % interval)",
        "explains",
        "indistinguishable from",
    ]);
    for finding in &report.findings {
        let rivals: Vec<String> = finding.equivalent_to.iter().map(rival).collect();
        table.add_row([
            finding.effect.clone(),
            place(finding),
            parameters(finding),
            format!("{:.1} %", 100.0 * finding.explains),
            rivals.join("\n"),
        ]);
    }
    if let Some(column) = table.column_mut(3) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn place(finding: &Finding) -> String {
    let mut text = match (&finding.joint, &finding.link) {
        (Some(name), _) | (None, Some(name)) => name.clone(),
        (None, None) => "all joints".to_owned(),
    };
    if let Some(recording) = &finding.recording {
        text.push_str(&format!("\nin {recording}"));
    }
    if let (Some(start), Some(end)) = (finding.t_start, finding.t_end) {
        text.push_str(&format!("\n{start:.2} to {end:.2} s"));
    }
    text
}

/// Formats the parameters in the order of the effect's definition, e.g. a mass before its inertia.
fn parameters(finding: &Finding) -> String {
    let intervals = &finding.intervals_95;
    let effect = terms::effect(&finding.effect);
    let rank = |name: &str| {
        let known = effect.map_or(&[][..], |effect| effect.parameters);
        let place = known.iter().position(|parameter| parameter.name == name);
        place.unwrap_or(usize::MAX)
    };
    let mut named: Vec<(&String, &Value)> = finding.parameters.iter().collect();
    named.sort_by_key(|(name, _)| rank(name));
    let lines = named.into_iter().map(|(name, value)| match value {
        Value::Number(number) => {
            let value = number.as_f64().map_or_else(|| number.to_string(), figure);
            let (label, unit) = finding.label_and_unit(name);
            let unit = if unit.is_empty() {
                unit
            } else {
                format!(" {unit}")
            };
            format!("{label} {value}{unit}{}", interval(name, intervals))
        }
        Value::String(text) => format!("{name} {text}"),
        other => format!("{name} {other}"),
    });
    lines.collect::<Vec<_>>().join("\n")
}

fn interval(name: &str, intervals: &BTreeMap<String, [f64; 2]>) -> String {
    match intervals.get(name) {
        Some([low, high]) if low.is_finite() && high.is_finite() => {
            format!(" ({} to {})", figure(*low), figure(*high))
        }
        _ => String::new(),
    }
}

/// Formats a number with four significant digits.
fn figure(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = (3 - value.abs().log10().floor() as i32).clamp(0, 6);
    format!("{value:.*}", digits as usize)
}

fn rival(rival: &Rival) -> String {
    let place = rival.joint.as_ref().or(rival.link.as_ref());
    match place {
        Some(place) => format!("{} at {place}", rival.effect),
        None => rival.effect.clone(),
    }
}

fn proof(report: &Report) -> Table {
    let unit = report.effort_unit_at(None);
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    let sliding = match &report.sliding_joints[..] {
        joints if joints.is_empty() || unit != "N m" => String::new(),
        joints => format!(", N at {}", joints.join(", ")),
    };
    table.set_header([
        format!("RMS on the hold-out [{unit}{sliding}]"),
        "before".to_owned(),
        "after".to_owned(),
        "noise".to_owned(),
    ]);
    let number = |values: &[f64], index: usize| {
        let value = values.get(index).copied().filter(|value| value.is_finite());
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.4}"))
    };
    for (index, joint) in report.joints.iter().enumerate() {
        table.add_row([
            joint.clone(),
            number(&report.holdout_rms_before, index),
            number(&report.holdout_rms_after, index),
            number(&report.noise_floor, index),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
