//! Collision or cooperation: Salt Ducaju et al., tables I and II.

use std::collections::BTreeMap;

use super::{Table, mean_sd_ms, number, part, percent};
use crate::judged::Judged;
use crate::metrics::Matched;
use crate::metrics::statistics::{Distribution, mean_sd};

const CONTACT: &str = "contact";
const COLLISION: &str = "collision";
const COOPERATION: &str = "cooperation";

/// Tables of the two kinds, if both the labels and at least one detector distinguish them.
pub fn tables(judged: &[Judged<'_>]) -> Vec<Table> {
    let telling: Vec<&Judged<'_>> = judged.iter().filter(|j| j.tells_kinds()).collect();
    let labelled = |kind| {
        let mut all = telling.iter().flat_map(|judged| judged.matched());
        all.any(|matched| matched.event.kind == kind)
    };
    if !(labelled(COLLISION) && labelled(COOPERATION)) {
        return Vec::new();
    }
    let mut tables = vec![confusion(&telling)];
    tables.extend(telling.iter().filter_map(|judged| operators(judged)));
    tables.push(delays(&telling));
    tables
}

/// Events that the tables count: all except collisions on top of a cooperation, as in the paper.
fn counted<'a>(judged: &Judged<'a>) -> Vec<Matched<'a>> {
    let on_top = |matched: &Matched<'_>| {
        matched.event.kind == COLLISION && matched.event.during.as_deref() == Some(COOPERATION)
    };
    judged
        .matched()
        .filter(|matched| !on_top(matched))
        .collect()
}

/// Number of found events of kind `truly` that were classified as `said`.
fn told(matched: &[Matched<'_>], truly: &str, said: &str) -> usize {
    let found = |m: &&Matched<'_>| {
        m.event.kind == truly && m.detection.is_some_and(|detection| detection.kind == said)
    };
    matched.iter().filter(found).count()
}

fn missed(matched: &[Matched<'_>], truly: &str) -> usize {
    let missed = |m: &&Matched<'_>| m.event.kind == truly && m.detection.is_none();
    matched.iter().filter(missed).count()
}

fn confusion(judged: &[&Judged<'_>]) -> Table {
    let mut table = Table::new(
        "Collision or cooperation (Salt Ducaju et al., table I)",
        "Found events; collisions on top of a cooperation are left out, as in the paper. Specificity: collisions classified right; sensitivity: cooperations classified right; \"of all\" counts missed events as wrong.",
        &[
            "detector",
            "collision: right",
            "wrong",
            "missed",
            "cooperation: right",
            "wrong",
            "missed",
            "specificity",
            "sensitivity",
            "accuracy",
            "of all",
        ],
    );
    for judged in judged {
        let all = counted(judged);
        let (cc, co) = (
            told(&all, COLLISION, COLLISION),
            told(&all, COLLISION, COOPERATION),
        );
        let (oo, oc) = (
            told(&all, COOPERATION, COOPERATION),
            told(&all, COOPERATION, COLLISION),
        );
        let share = |count, of| format!("{} %", percent(count, of));
        table.row([
            judged.label.clone(),
            cc.to_string(),
            co.to_string(),
            missed(&all, COLLISION).to_string(),
            oo.to_string(),
            oc.to_string(),
            missed(&all, COOPERATION).to_string(),
            share(cc, cc + co),
            share(oo, oo + oc),
            share(cc + oo, cc + co + oo + oc),
            share(cc + oo, all.len()),
        ]);
    }
    table
}

fn operators(judged: &Judged<'_>) -> Option<Table> {
    let all = counted(judged);
    let mut names: BTreeMap<&str, Option<bool>> = BTreeMap::new();
    for event in all.iter().map(|matched| matched.event) {
        if let Some(name) = event.operator.as_deref() {
            let known = names.entry(name).or_default();
            *known = known.or(event.experienced);
        }
    }
    if names.is_empty() {
        return None;
    }
    let mut table = Table::new(
        format!("Cooperation by operator, {} (table II)", judged.label),
        "Shares are of the operator's cooperations, missed ones included.",
        &["operator", "as collision", "as cooperation", "missed"],
    );
    let mut right = Vec::new();
    for (name, experienced) in names {
        let own: Vec<Matched<'_>> = (all.iter())
            .filter(|m| m.event.kind == COOPERATION && m.event.operator.as_deref() == Some(name))
            .copied()
            .collect();
        let hits = told(&own, COOPERATION, COOPERATION);
        right.push((experienced, 100.0 * hits as f64 / own.len() as f64));
        table.row([
            format!(
                "{name}{}",
                if experienced == Some(true) {
                    " (experienced)"
                } else {
                    ""
                }
            ),
            part(told(&own, COOPERATION, COLLISION), own.len()),
            part(hits, own.len()),
            missed(&own, COOPERATION).to_string(),
        ]);
    }
    for (name, of) in [
        ("mean of all", None),
        ("of the experienced", Some(true)),
        ("of the others", Some(false)),
    ] {
        let shares: Vec<f64> = (right.iter())
            .filter(|(experienced, _)| of.is_none() || of == *experienced)
            .map(|(_, share)| *share)
            .collect();
        if shares.is_empty() {
            continue;
        }
        let (mean, sd) = mean_sd(&shares);
        let said = format!("{} ± {} %", number(mean, 1), number(sd, 1));
        table.row([name.to_owned(), String::new(), said, String::new()]);
    }
    Some(table)
}

fn delays(judged: &[&Judged<'_>]) -> Table {
    let mut table = Table::new(
        "Detection times by kind and context",
        "Context: the contact during which it began. \"all\" leaves out collisions on top of a cooperation, as table I does.",
        &[
            "detector",
            "kind",
            "context",
            "found",
            "classified right",
            "delay [ms]",
            "p95",
        ],
    );
    for judged in judged {
        for kind in [COLLISION, COOPERATION] {
            let all = counted(judged).into_iter();
            let all: Vec<_> = all.filter(|m| m.event.kind == kind).collect();
            table.rows.extend(delay(judged, kind, "all", &all));
            for context in [None, Some(CONTACT), Some(COLLISION), Some(COOPERATION)] {
                let own: Vec<_> = (judged.matched())
                    .filter(|m| m.event.kind == kind && m.event.during.as_deref() == context)
                    .collect();
                let row = delay(judged, kind, context.unwrap_or("free"), &own);
                table.rows.extend(row);
            }
        }
    }
    table
}

/// Row of a kind and context, if there are such contacts.
fn delay(
    judged: &Judged<'_>,
    kind: &str,
    context: &str,
    own: &[Matched<'_>],
) -> Option<Vec<String>> {
    if own.is_empty() {
        return None;
    }
    let found = own.len() - missed(own, kind);
    let delay = Distribution::of(own.iter().filter_map(Matched::delay_s));
    Some(vec![
        judged.label.clone(),
        kind.to_owned(),
        context.to_owned(),
        part(found, own.len()),
        part(told(own, kind, kind), own.len()),
        mean_sd_ms(&delay),
        super::ms(delay.p95),
    ])
}
