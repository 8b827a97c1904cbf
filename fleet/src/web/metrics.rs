//! Metrics of all cells for Prometheus, in the `OpenMetrics` format. Metric names contain base units. `deploy/`
//! contains a dashboard and alert rules for them.

use axum::extract::State as Extract;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use prometheus_client::encoding::{EncodeLabelSet, text::encode};
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::{Registry, Unit};

use crate::wall::{CellView, Snapshot, State};

const TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

#[derive(Debug, Clone, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Cell {
    cell: String,
}

#[derive(Debug, Clone, Hash, PartialEq, Eq, EncodeLabelSet)]
struct CellState {
    cell: String,
    state: &'static str,
}

#[derive(Debug, Clone, Hash, PartialEq, Eq, EncodeLabelSet)]
struct CellJoint {
    cell: String,
    joint: String,
    unit: String,
}

#[derive(Debug, Clone, Hash, PartialEq, Eq, EncodeLabelSet)]
struct CellStage {
    cell: String,
    stage: String,
}

#[derive(Debug, Clone, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Reason {
    reason: &'static str,
}

#[derive(Debug, Clone, Hash, PartialEq, Eq, EncodeLabelSet)]
struct CellInfo {
    cell: String,
    host: String,
    robot: String,
    tauscope: String,
    urdf_sha256: String,
    twin_sha256: String,
}

type Reals<L> = Family<L, Gauge<f64, std::sync::atomic::AtomicU64>>;

/// Metric families of one response.
#[derive(Default)]
struct Families {
    state: Family<CellState, Gauge>,
    info: Family<CellInfo, Gauge>,
    status_age: Reals<Cell>,
    sample_age: Reals<Cell>,
    contacts: Family<Cell, Gauge>,
    lost: Family<CellStage, Gauge>,
    restarts: Family<CellStage, Gauge>,
    residual: Reals<CellJoint>,
    offset: Reals<CellJoint>,
    ratio: Reals<Cell>,
    changes: Family<Cell, Gauge>,
    clock: Reals<Cell>,
    clock_uncertainty: Reals<Cell>,
    refused: Family<Reason, Gauge>,
}

pub async fn metrics(Extract(shared): Extract<std::sync::Arc<super::Shared>>) -> Response {
    let snapshot = shared.hub.snapshot();
    match text(&snapshot) {
        Ok(text) => ([(header::CONTENT_TYPE, TYPE)], text).into_response(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

fn text(snapshot: &Snapshot) -> Result<String, std::fmt::Error> {
    let families = Families::default();
    for view in &snapshot.cells {
        families.take(view);
    }
    for (reason, count) in &snapshot.refused {
        families
            .refused
            .get_or_create(&Reason { reason })
            .set(whole(*count));
    }
    let mut registry = Registry::with_prefix("tauscope_fleet");
    families.register(&mut registry);
    let sessions = Gauge::<i64>::default();
    sessions.set(whole(snapshot.sessions_reached as u64));
    registry.register(
        "sessions",
        "Zenoh sessions that the fleet host reaches",
        sessions,
    );
    let mut text = String::new();
    encode(&mut text, &registry)?;
    Ok(text)
}

fn whole(count: u64) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

impl Families {
    fn take(&self, view: &CellView) {
        let cell = || Cell {
            cell: view.cell.clone(),
        };
        for state in State::NAMES {
            let labels = CellState {
                cell: view.cell.clone(),
                state,
            };
            let is_it = view.state.name() == state;
            self.state.get_or_create(&labels).set(is_it.into());
        }
        let seconds = |ms: u64| ms as f64 * 1e-3;
        if let Some(age_ms) = view.status_age_ms {
            self.status_age.get_or_create(&cell()).set(seconds(age_ms));
        }
        if let Some(age_ms) = view.sample_age_ms {
            self.sample_age.get_or_create(&cell()).set(seconds(age_ms));
        }
        if let Some(ahead_ms) = view.clock_ahead_ms {
            self.clock.get_or_create(&cell()).set(ahead_ms * 1e-3);
        }
        if let Some(most_ms) = view.clock_uncertainty_ms {
            let most_s = most_ms * 1e-3;
            self.clock_uncertainty.get_or_create(&cell()).set(most_s);
        }
        if let Some(residual) = &view.residual {
            self.ratio.get_or_create(&cell()).set(residual.ratio);
        }
        let Some(status) = &view.status else { return };
        self.contacts
            .get_or_create(&cell())
            .set(whole(status.contacts_today));
        self.changes
            .get_or_create(&cell())
            .set(whole(status.changes.len() as u64));
        let info = CellInfo {
            cell: view.cell.clone(),
            host: status.host.clone(),
            robot: status.robot.clone(),
            tauscope: status.tauscope.clone(),
            urdf_sha256: status.urdf_sha256.clone().unwrap_or_default(),
            twin_sha256: status.twin_sha256.clone().unwrap_or_default(),
        };
        self.info.get_or_create(&info).set(1);
        for stage in &status.stages {
            let labels = CellStage {
                cell: view.cell.clone(),
                stage: stage.stage.clone(),
            };
            self.lost.get_or_create(&labels).set(whole(stage.dropped));
            self.restarts
                .get_or_create(&labels)
                .set(whole(stage.restarts));
        }
        for joint in status.residual.iter().flat_map(|residual| &residual.joints) {
            let labels = CellJoint {
                cell: view.cell.clone(),
                joint: joint.name.clone(),
                unit: status.effort_unit.clone(),
            };
            self.residual.get_or_create(&labels).set(joint.rms);
            self.offset.get_or_create(&labels).set(joint.mean);
        }
    }

    fn register(self, registry: &mut Registry) {
        let seconds = || Unit::Seconds;
        registry.register(
            "cell_state",
            "1 for the state of the cell, 0 for all others",
            self.state,
        );
        registry.register(
            "cell",
            "Host, robot, version and hashes of the cell's files; always 1",
            self.info,
        );
        let help = "Time since the newest status of the cell arrived";
        registry.register_with_unit("status_age", help, seconds(), self.status_age);
        let help = "Time since the newest sample arrived in the cell";
        registry.register_with_unit("sample_age", help, seconds(), self.sample_age);
        let help = "Offset of the cell's clock from the fleet host's, positive if ahead";
        registry.register_with_unit("clock_ahead", help, seconds(), self.clock);
        let help = "Bound on the error of the measured clock_ahead";
        registry.register_with_unit("clock_uncertainty", help, seconds(), self.clock_uncertainty);
        registry.register(
            "contacts_today",
            "Contacts since 00:00 UTC or the start of the cell",
            self.contacts,
        );
        let help = "Samples that the stage misses since it started";
        registry.register("lost_samples", help, self.lost);
        registry.register(
            "stage_restarts",
            "Number of restarts of the stage",
            self.restarts,
        );
        let help = "Root mean square of the residual over a minute, in the unit of the label";
        registry.register("residual_rms", help, self.residual);
        let help = "Mean of the residual over a minute, in the unit of the label";
        registry.register("residual_mean", help, self.offset);
        let unit = Unit::Ratios;
        let help = "The residual over the cell's own normal";
        registry.register_with_unit("residual_to_normal", help, unit, self.ratio);
        registry.register(
            "changes",
            "Changes of the arm that a watch reports now",
            self.changes,
        );
        let help = "Messages that were refused since the fleet host started";
        registry.register("refused_messages", help, self.refused);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;
    use crate::wall::{Event, Now, Wall};

    fn shown() -> String {
        let mut wall = Wall::new(["b".to_owned()]);
        let now = Now {
            running_ms: 7,
            unix_ns: 5_000_000_000,
        };
        wall.take(Event::Reached(1), now);
        let (cell, instance) = ("a".to_owned(), "x".to_owned());
        wall.take(
            Event::Alive {
                cell: cell.clone(),
                instance,
            },
            now,
        );
        let mut status = fixture::status("x", 5);
        // A name from an untrusted cell must not break a line.
        status.robot = "arm\"\\ {x}".to_owned();
        let status = Box::new(status);
        let clock = Event::Clock {
            cell: cell.clone(),
            instance: "x".to_owned(),
            offset: tauscope_bus::clock::Offset {
                ahead_ns: -340_000_000,
                uncertainty_ns: 2_000_000,
            },
        };
        wall.take(Event::Status { cell, status }, now);
        wall.take(clock, now);
        wall.take(Event::Refused("too long"), now);
        text(&wall.snapshot()).unwrap()
    }

    #[test]
    fn each_cell_has_its_state_ages_and_residuals_with_base_units() {
        let text = shown();
        for line in [
            "tauscope_fleet_cell_state{cell=\"a\",state=\"running\"} 1",
            "tauscope_fleet_cell_state{cell=\"b\",state=\"never_seen\"} 1",
            "tauscope_fleet_sample_age_seconds{cell=\"a\"} 0.002",
            "tauscope_fleet_lost_samples{cell=\"a\",stage=\"twin\"} 0",
            "tauscope_fleet_residual_rms{cell=\"a\",joint=\"joint2\",unit=\"Nm\"} 1.5",
            "tauscope_fleet_refused_messages{reason=\"too long\"} 1",
            "tauscope_fleet_clock_ahead_seconds{cell=\"a\"} -0.34",
            "tauscope_fleet_clock_uncertainty_seconds{cell=\"a\"} 0.002",
            "tauscope_fleet_sessions 1",
        ] {
            assert!(text.lines().any(|shown| shown == line), "{line} in\n{text}");
        }
        assert!(text.contains(r#"robot="arm\"\\ {x}""#), "{text}");
        assert!(text.ends_with("# EOF\n"));
    }

    #[test]
    fn the_board_and_the_rules_name_metrics_that_there_are() {
        let text = shown();
        let there: Vec<&str> = text
            .lines()
            .filter_map(|line| line.strip_prefix("# TYPE ")?.split(' ').next())
            .collect();
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy");
        for file in ["grafana/fleet.json", "prometheus/alerts.yaml"] {
            let shipped = std::fs::read_to_string(format!("{root}/{file}")).unwrap();
            let mut named = 0;
            for part in shipped.split("tauscope_fleet_").skip(1) {
                let end = part.find(|c: char| !c.is_ascii_alphanumeric() && c != '_');
                let name = format!("tauscope_fleet_{}", &part[..end.unwrap_or(part.len())]);
                assert!(
                    there.contains(&name.as_str()),
                    "{file}: {name} of {there:?}"
                );
                named += 1;
            }
            assert!(named >= 6, "{file} names {named} metrics");
        }
    }
}
