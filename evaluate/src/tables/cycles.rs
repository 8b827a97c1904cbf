//! Collisions in a cyclic motion: Indri, Trapani and Lazzero, tables 1 to 4.

use super::{Table, mean_sd_ms, number, part};
use crate::input::Request;
use crate::judged::Judged;
use crate::labels::TrueEvent;
use crate::metrics::Matched;
use crate::metrics::statistics::Distribution;

const BASIC: &str = "virtual_collision_sensor_basic";
const ADAPTIVE: &str = "virtual_collision_sensor";

/// Events that a row covers.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Group {
    Place(Option<String>, Option<String>),
    Material(String),
}

impl Group {
    fn name(&self) -> String {
        match self {
            Self::Place(motion, zone) => {
                let parts: Vec<&str> = [motion, zone]
                    .into_iter()
                    .flatten()
                    .map(String::as_str)
                    .collect();
                parts.join(" ")
            }
            Self::Material(material) => material.clone(),
        }
    }

    fn holds(&self, event: &TrueEvent) -> bool {
        match self {
            Self::Place(motion, zone) => event.motion == *motion && event.zone == *zone,
            Self::Material(material) => event.material.as_ref() == Some(material),
        }
    }
}

/// Tables of the paper, if the labels name materials, motions or zones.
pub fn tables(request: &Request, judged: &[Judged<'_>]) -> Vec<Table> {
    let mut groups: Vec<Group> = Vec::new();
    for matched in judged.iter().flat_map(Judged::matched) {
        let event = matched.event;
        if event.motion.is_some() || event.zone.is_some() {
            groups.push(Group::Place(event.motion.clone(), event.zone.clone()));
        }
        groups.extend(event.material.clone().map(Group::Material));
    }
    groups.sort();
    groups.dedup();
    if groups.is_empty() {
        return Vec::new();
    }
    let joints = &request.cell.facts.joint_names;
    let mut tables: Vec<Table> = (judged.iter())
        .map(|judged| detector(judged, &groups, joints))
        .collect();
    tables.extend(reduction(judged, &groups));
    tables.push(clean(judged));
    tables
}

fn group<'a>(judged: &Judged<'a>, group: &Group) -> Vec<Matched<'a>> {
    judged.matched().filter(|m| group.holds(m.event)).collect()
}

fn delay(matched: &[Matched<'_>]) -> Distribution {
    Distribution::of(matched.iter().filter_map(Matched::delay_s))
}

fn detector(judged: &Judged<'_>, groups: &[Group], joints: &[String]) -> Table {
    let mut table = Table::new(
        format!(
            "Detection times and detecting axes, {} (Indri et al., tables 1 to 4)",
            judged.label
        ),
        "Axes: number of found collisions that each joint detected.",
        &["test", "found", "DT [ms]", "p95 [ms]"],
    );
    table
        .head
        .extend((1..=joints.len()).map(|axis| format!("ax{axis}")));
    for one in groups {
        let own = group(judged, one);
        let found: Vec<_> = own.iter().filter_map(|m| m.detection).collect();
        let delay = delay(&own);
        let mut row = vec![
            one.name(),
            part(found.len(), own.len()),
            mean_sd_ms(&delay),
            super::ms(delay.p95),
        ];
        row.extend(joints.iter().map(|joint| {
            let detects = found.iter().filter(|event| event.joints.contains(joint));
            detects.count().to_string()
        }));
        table.row(row);
    }
    table
}

/// Reduction of the detection time by adaptation, behind each twin.
fn reduction(judged: &[Judged<'_>], groups: &[Group]) -> Option<Table> {
    let mut table = Table::new(
        "From the basic to the adaptive virtual collision sensor (table 1)",
        "",
        &["test", "basic DT [ms]", "adaptive DT [ms]", "reduction"],
    );
    let named = |name: &str, twin: usize| {
        judged
            .iter()
            .find(|judged| judged.run.twin == twin && judged.run.first().entry.name == name)
    };
    for basic in judged.iter().filter(|j| j.run.first().entry.name == BASIC) {
        let Some(adaptive) = named(ADAPTIVE, basic.run.twin) else {
            continue;
        };
        for one in groups {
            let (before, after) = (delay(&group(basic, one)), delay(&group(adaptive, one)));
            let reduction = 100.0 * (1.0 - after.mean / before.mean);
            table.row([
                one.name(),
                mean_sd_ms(&before),
                mean_sd_ms(&after),
                format!("{} %", number(reduction, 0)),
            ]);
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

fn clean(judged: &[Judged<'_>]) -> Table {
    let mut table = Table::new(
        "False alarms",
        "",
        &[
            "detector",
            "in recordings without any contact",
            "per hour",
            "in the clean parts of the others",
        ],
    );
    for judged in judged {
        let count = |eventful: bool| {
            let own = judged.scored.iter().filter(|one| one.eventful == eventful);
            own.map(|one| one.matching.false_alarms.len())
                .sum::<usize>()
        };
        let quiet = judged.scored.iter().filter(|one| !one.eventful);
        let hours = quiet.map(|one| one.duration_s).sum::<f64>() / 3600.0;
        table.row([
            judged.label.clone(),
            count(false).to_string(),
            number(count(false) as f64 / hours, 1),
            count(true).to_string(),
        ]);
    }
    table
}
