//! Tables that compare all detectors.

use tauscope_detect::Training;

use super::{Table, mean_sd_ms, ms, number, over_seeds, part};
use crate::evaluation::Evaluation;
use crate::judged::Judged;
use crate::metrics::Numbers;
use crate::metrics::events::MERGE_S;
use crate::metrics::numbers::SampleNumbers;
use crate::recording::Role;

/// Gain, offset and noise of the twins by joint: Tajiri and Iwamoto, equations 9 and 10.
pub fn twins(evaluation: &Evaluation) -> Table {
    let facts = &evaluation.request.cell.facts;
    let unit = facts.effort_unit.as_str();
    let mut table = Table::new("Twins", "", &["joint"]);
    for twin in &evaluation.twins {
        let of = |what: &str| format!("{} {what}", twin.name);
        table.head.extend([
            of("gain"),
            of(&format!("offset [{unit}]")),
            of(&format!("noise [{unit}]")),
        ]);
        let filters = twin.config.filters(Some(twin.file.filters));
        let mut said = format!(
            "{}: low-pass {} Hz on efforts, {} Hz on velocity",
            twin.name, filters.effort_cutoff_hz, filters.velocity_cutoff_hz
        );
        if !twin.file.terms.is_empty() {
            said.push_str(&format!(
                ", {} corrections of its physics",
                twin.file.terms.len()
            ));
        }
        if let Some(fit_s) = twin.fit_s {
            said.push_str(&format!(
                ", fitted on the contact-free part of the train recordings in {fit_s:.2} s with reading"
            ));
        }
        if !table.note.is_empty() {
            table.note.push_str("; ");
        }
        table.note.push_str(&said);
    }
    table
        .note
        .push_str(". Noise: of the residual on validation, about zero.");
    for name in &facts.joint_names {
        let mut row = vec![name.clone()];
        for twin in &evaluation.twins {
            let joint = twin.file.joints.get(name).copied().unwrap_or_default();
            row.push(number(joint.gain, 3));
            row.push(number(joint.offset, 3));
            row.push(number(joint.noise.unwrap_or(f64::NAN), 3));
        }
        table.row(row);
    }
    table
}

/// Figures per sample: Tajiri and Iwamoto, table II.
pub fn samples(judged: &[Judged<'_>]) -> Table {
    let share = judged
        .first()
        .map_or(f64::NAN, |j| j.first().samples.contact_share);
    let note = format!(
        "{:.1} % of the samples are in a contact. Best F1 is over the steps mean + i sigma of the validation scores; the threshold that was set may lie between two of them and do a little better.",
        100.0 * share
    );
    let regressed = |judged: &Judged<'_>| {
        let runner = judged.run.first();
        runner.entry.training == Training::Twin && runner.training_s.is_finite()
    };
    let regression = if judged.iter().any(regressed) {
        " The training of twin_regression is the regression, with reading."
    } else {
        ""
    };
    let note = format!("{note}{regression}");
    let mut table = Table::new(
        "Sample by sample (Tajiri and Iwamoto, table II)",
        note,
        &[
            "detector",
            "training [s]",
            "test [s]",
            "threshold",
            "F1 at it",
            "best F1",
            "at i =",
            "AUC",
        ],
    );
    for judged in judged {
        let seeds = &judged.run.seeds;
        let training: Vec<f64> = seeds.iter().map(|runner| runner.training_s).collect();
        let test: Vec<f64> = (seeds.iter())
            .map(|runner| {
                let test = runner.outputs.iter().filter(|o| o.role == Role::Test);
                test.map(|output| output.took_s).sum()
            })
            .collect();
        let mut row = vec![
            judged.label.clone(),
            over_seeds(&training, 3),
            over_seeds(&test, 4),
            format!("{:.4}", judged.run.first().threshold),
        ];
        row.extend(scores(&judged.numbers, |numbers| Some(&numbers.samples)));
        table.row(row);
    }
    table
}

/// Figures per window, for the detectors that judge windows.
pub fn windows(judged: &[Judged<'_>]) -> Option<Table> {
    let mut table = Table::new(
        "Window by window",
        "A window is positive if any of its samples is.",
        &["detector", "F1 at threshold", "best F1", "at i =", "AUC"],
    );
    for judged in judged
        .iter()
        .filter(|judged| judged.first().windows.is_some())
    {
        let mut row = vec![judged.label.clone()];
        row.extend(scores(&judged.numbers, |numbers| numbers.windows.as_ref()));
        table.row(row);
    }
    (!table.rows.is_empty()).then_some(table)
}

fn scores(numbers: &[Numbers], of: impl Fn(&Numbers) -> Option<&SampleNumbers>) -> [String; 4] {
    let all: Vec<&SampleNumbers> = numbers.iter().filter_map(of).collect();
    let column = |value: fn(&SampleNumbers) -> f64| -> Vec<f64> {
        all.iter().map(|numbers| value(numbers)).collect()
    };
    let sigmas = all.first().map_or(f64::NAN, |numbers| numbers.best_sigmas);
    [
        over_seeds(&column(|n| n.f1), 3),
        over_seeds(&column(|n| n.best_f1), 3),
        number(sigmas, usize::from(sigmas < 1.0)),
        over_seeds(&column(|n| n.auc), 3),
    ]
}

/// Events, false alarms and delays.
pub fn events(judged: &[Judged<'_>], recovery_s: f64) -> Table {
    let minutes = judged
        .first()
        .map_or(f64::NAN, |j| 60.0 * j.first().free_hours);
    let mut table = Table::new(
        "Event by event",
        format!(
            "{minutes:.1} contact-free minutes. Alarms: all, also repeated ones while a contact lasts. False alarms: those that belong to no contact and come later than {recovery_s} s after one (`recovery_s` of the set); those within {MERGE_S} s count once. Strict: every alarm that begins outside the labelled contacts. Delay: from the labelled beginning to the alarm."
        ),
        &[
            "detector",
            "found",
            "alarms",
            "false alarms",
            "per hour",
            "false alarms/h under (95 %)",
            "strict",
            "strict per hour",
            "free time in alarm",
            "delay [ms]",
            "p50 [ms]",
            "p90 [ms]",
            "p99 [ms]",
        ],
    );
    for judged in judged {
        let first = judged.first();
        let rates: Vec<f64> = (judged.numbers.iter())
            .map(|n| n.false_alarms_per_hour)
            .collect();
        let strict_rates: Vec<f64> = (judged.numbers.iter())
            .map(|n| n.strict_false_alarms_per_hour)
            .collect();
        table.row([
            judged.label.clone(),
            part(first.found, first.events),
            first.alarms.to_string(),
            first.false_alarms.to_string(),
            over_seeds(&rates, 1),
            number(first.false_alarms_per_hour_bound, 1),
            first.strict_false_alarms.to_string(),
            over_seeds(&strict_rates, 1),
            format!("{} %", number(100.0 * first.free_share_in_alarm, 2)),
            mean_sd_ms(&first.delay_s),
            ms(first.delay_s.p50),
            ms(first.delay_s.p90),
            ms(first.delay_s.p99),
        ]);
    }
    table
}

/// Estimated link and force direction.
pub fn places(judged: &[Judged<'_>]) -> Table {
    let mut table = Table::new(
        "Where",
        "Links over all events: a missed event, or one without a reported link, is wrong. Alone: exactly one link was reported, and it is right. One of two: the touched link was reported, alone or as one of two. Force: angle to the true force, over found events.",
        &[
            "detector",
            "link exact",
            "within one",
            "alone, right",
            "one of two",
            "force [deg]",
            "p50 [deg]",
            "p90 [deg]",
        ],
    );
    for judged in judged {
        let first = judged.first();
        let force = &first.force_error_deg;
        let mean = match force.count {
            0 => "-".to_owned(),
            _ => format!("{:.0} ± {:.0}", force.mean, force.sd),
        };
        table.row([
            judged.label.clone(),
            part(first.link_exact, first.links),
            part(first.link_within_one, first.links),
            part(first.link_alone_exact, first.link_alone),
            part(first.link_told, first.links),
            mean,
            number(force.p50, 0),
            number(force.p90, 0),
        ]);
    }
    table
}

/// Detections without scores, for recordings without labels.
pub fn unscored(evaluation: &Evaluation, judged: &[Judged<'_>]) -> Table {
    let mut tests = evaluation.request.recordings.iter();
    let note = if tests.any(|recording| recording.role == Role::Test) {
        "The test recordings have no labels: nothing was scored."
    } else {
        "There are no test recordings: nothing was scored."
    };
    let head = ["detector", "threshold", "detections", "time in alarm [s]"];
    let mut table = Table::new("Detections", note, &head);
    for judged in judged {
        let runner = judged.run.first();
        let test = (runner.outputs.iter()).filter(|output| output.role == Role::Test);
        let events: Vec<_> = test.flat_map(|output| &output.events).collect();
        // `sum` of no values is -0.
        let alarm = events
            .iter()
            .fold(0.0, |sum, event| sum + (event.t_off - event.t));
        table.row([
            judged.label.clone(),
            format!("{:.4}", runner.threshold),
            events.len().to_string(),
            number(alarm, 1),
        ]);
    }
    table
}

/// Smallest force that `tauscope` finds, by link, for its own rate of false alarms and two others.
pub fn smallest(judged: &[Judged<'_>]) -> Vec<Table> {
    let tables = judged.iter().filter_map(|one| {
        let settings = one.run.first().config.settings::<tauscope_detect::tauscope::Settings>()?;
        let wish = settings.false_alarms_per_hour;
        let usual = [(1.0, "one an hour"), (1.0 / (7.0 * 24.0), "one a week")];
        let mut wishes = vec![(wish, format!("{wish} an hour"))];
        let others = usual.into_iter().filter(|(other, _)| (other - wish).abs() > 1e-9);
        wishes.extend(others.map(|(other, said)| (other, said.to_owned())));
        let mut table = Table::new(
            format!("Smallest force found, {}", one.label),
            "Smallest force that is found once it has lasted 0.2 s [N], by the tolerated rate of false alarms: in half, and in nine of ten, of the postures and directions of the contact-free recordings.",
            &["link"],
        );
        for (_, said) in &wishes {
            table.head.extend([format!("{said}: half"), "nine of ten".to_owned()]);
        }
        let forces: Vec<_> = (wishes.iter())
            .map(|(per_hour, _)| settings.smallest_forces(*per_hour))
            .collect();
        for (i, of_link) in forces[0].iter().enumerate() {
            let mut row = vec![of_link.link.clone()];
            for forces in &forces {
                let both = [forces[i].half_n, forces[i].most_n];
                row.extend(both.map(findable));
            }
            table.row(row);
        }
        (!table.rows.is_empty()).then_some(table)
    });
    tables.collect()
}

/// Formats a force \[N\]; one above what an arm withstands is shown as a lower bound.
fn findable(force_n: Option<f64>) -> String {
    /// Largest force that is shown as a number \[N\].
    /// Physical: ten times the weight that a collaborative arm for 20 kg carries.
    const MOST_N: f64 = 2000.0;
    match force_n {
        Some(force_n) if force_n > MOST_N => format!("over {MOST_N}"),
        force_n => number(force_n.unwrap_or(f64::NAN), 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_that_breaks_the_arm_is_no_force_that_is_found() {
        assert_eq!(findable(Some(88_373.3)), "over 2000");
        assert_eq!(findable(Some(12.34)), "12.3");
    }
}
