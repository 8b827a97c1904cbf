//! Detections, the alarm and health as `diagnostic_msgs/msg/DiagnosticArray`.

use tauscope_archive::ros::{self, DiagnosticArray, DiagnosticStatus, KeyValue, Level};
use tauscope_bus::{Detection, Health};

use crate::message::{AlarmMessage, AlarmState, CommandMessage, DetectionMessage, EventMessage};

/// Builds an array of one status at the time `stamp_ns`.
fn array(
    stamp_ns: i64,
    level: Level,
    name: &str,
    message: String,
    cell: &str,
    values: Vec<(&str, String)>,
) -> DiagnosticArray {
    let values = values.into_iter().map(|(key, value)| KeyValue {
        key: key.to_owned(),
        value,
    });
    DiagnosticArray {
        header: ros::Header::new(stamp_ns, ""),
        status: vec![DiagnosticStatus {
            level: level as u8,
            name: name.to_owned(),
            message,
            hardware_id: cell.to_owned(),
            values: values.collect(),
        }],
    }
}

/// Converts a detection; `label` distinguishes the detector from the cell's others.
pub fn of_detection(message: &DetectionMessage, label: &str, cell: &str) -> DiagnosticArray {
    let level = match (message.alarm, message.state.as_str()) {
        (true, "collision") => Level::Error,
        (true, _) => Level::Warn,
        (false, "not_ready") => Level::Stale,
        (false, _) => Level::Ok,
    };
    let event = match message.event {
        Some(EventMessage::Onset) => "onset",
        Some(EventMessage::Offset) => "offset",
        None => "state",
    };
    let mut values = vec![
        ("event", event.to_owned()),
        ("detector", message.detector.clone()),
        ("state", message.state.clone()),
        ("score", message.score.to_string()),
        ("threshold", message.threshold.to_string()),
    ];
    if let Some(contact_ns) = message.contact_ns {
        let time = ros::Time::from_ns(contact_ns);
        values.push(("t_contact", format!("{}.{:09}", time.sec, time.nanosec)));
        values.push(("joints", message.joints.join(" ")));
    }
    if let Some(link) = &message.link {
        values.push(("link", link.clone()));
    }
    if let Some(other) = &message.other_link {
        values.push(("other_link", other.clone()));
    }
    if let Some([x, y, z]) = message.force_n {
        values.push(("force_n", format!("{x} {y} {z}")));
    }
    let words = match (&message.link, &message.other_link) {
        (Some(link), None) if message.alarm => format!("{} at {link}", message.state),
        (Some(link), Some(other)) if message.alarm => {
            format!("{} at {link} or {other}", message.state)
        }
        _ => message.state.replace('_', " "),
    };
    array(message.stamp_ns, level, label, words, cell, values)
}

/// Converts the state of the alarm.
pub fn of_alarm(alarm: &AlarmMessage, cell: &str) -> DiagnosticArray {
    let level = match alarm.state {
        AlarmState::Silent | AlarmState::NotReady => Level::Stale,
        AlarmState::Free => Level::Ok,
        AlarmState::Contact | AlarmState::Acknowledged => Level::Warn,
        AlarmState::Collision => Level::Error,
    };
    let words = if alarm.muted_s > 0.0 {
        format!(
            "{}, muted for {:.0} s",
            alarm.state.as_str(),
            alarm.muted_s.ceil()
        )
    } else {
        alarm.state.as_str().replace('_', " ")
    };
    let words = match alarm.state {
        AlarmState::Silent if alarm.latched_for_ms.is_some() => format!("{words}, still latched"),
        _ => words,
    };
    let values = vec![
        ("state", alarm.state.as_str().to_owned()),
        ("free", alarm.free.to_string()),
        ("contact", alarm.contact.to_string()),
        ("muted_s", alarm.muted_s.to_string()),
        ("latched", alarm.latched_for_ms.is_some().to_string()),
    ];
    array(alarm.stamp_ns, level, "alarm", words, cell, values)
}

/// Converts an accepted command.
pub fn of_command(command: &CommandMessage, cell: &str) -> DiagnosticArray {
    let values = command.arguments.iter();
    let values = values.map(|(name, value)| (name.as_str(), value.clone()));
    array(
        command.stamp_ns,
        Level::Ok,
        &command.verb,
        "taken".to_owned(),
        cell,
        values.collect(),
    )
}

/// Converts the health of a stage.
pub fn of_health(health: &Health, cell: &str) -> DiagnosticArray {
    let (level, words) = match health.dropped {
        0 => (Level::Ok, "nothing lost".to_owned()),
        dropped => (Level::Warn, format!("{dropped} samples lost")),
    };
    let values = [
        ("received", health.received),
        ("emitted", health.emitted),
        ("dropped", health.dropped),
        ("restarts", health.restarts),
    ];
    let values = values.map(|(name, count)| (name, count.to_string()));
    let name = health.stage.as_str();
    array(
        health.header.stamp_ns,
        level,
        name,
        words,
        cell,
        values.into(),
    )
}

/// Whether a detection needs a message of its own: something begins, ends or changes.
pub fn is_news(before: Option<&Detection>, now: &Detection) -> bool {
    now.event != 0
        || before.is_none_or(|before| (before.state, before.alarm()) != (now.state, now.alarm()))
}
