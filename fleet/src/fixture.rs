//! Messages for tests.

use tauscope_publish::message::{
    AlarmMessage, AlarmState, ChangeMessage, ContactMessage, HealthMessage, JointResidual, Record,
    RecordMessage, ResidualMessage, STATUS_VERSION, StatusMessage,
};

/// A status without a contact, of the publisher instance `instance`, sent at `sent_s`.
pub fn status(instance: &str, sent_s: i64) -> StatusMessage {
    StatusMessage {
        version: STATUS_VERSION,
        instance: instance.to_owned(),
        sent_ns: sent_s * 1_000_000_000,
        host: "cell-pc".to_owned(),
        tauscope: "0.1.0".to_owned(),
        robot: "demo_arm".to_owned(),
        effort_unit: "Nm".to_owned(),
        urdf_sha256: Some("ab".repeat(32)),
        twin_sha256: None,
        archive: Some("/home/cell/out/a-*.mcap".to_owned()),
        takes_commands: true,
        ended: false,
        alarm: AlarmMessage {
            state: AlarmState::Free,
            free: true,
            stamp_ns: sent_s * 1_000_000_000 + 1,
            ..AlarmMessage::silent()
        },
        last_sample_ns: Some(sent_s * 1_000_000_000),
        last_sample_age_ms: Some(2),
        contacts_today: 0,
        contacts_since_ns: 0,
        last_contact: None,
        last_record: 0,
        stages: vec![HealthMessage {
            stamp_ns: 0,
            stage: "twin".to_owned(),
            received: 100,
            emitted: 100,
            dropped: 0,
            restarts: 0,
        }],
        unsent: 0,
        residual: Some(ResidualMessage {
            stamp_ns: sent_s * 1_000_000_000,
            window_s: 60.0,
            joints: vec![
                JointResidual {
                    name: "joint1".to_owned(),
                    rms: 0.5,
                    mean: 0.1,
                    calibrated: Some(0.5),
                },
                JointResidual {
                    name: "joint2".to_owned(),
                    rms: 1.5,
                    mean: 1.2,
                    calibrated: Some(0.5),
                },
            ],
        }),
        changes: Vec::new(),
    }
}

/// An undeclared payload.
pub fn change() -> ChangeMessage {
    ChangeMessage {
        effect: "payload".to_owned(),
        link: Some("tool".to_owned()),
        joints: vec!["joint2".to_owned()],
        size: 2.1,
        since_ns: 0,
    }
}

/// A push at the fifth link that began at `begin_s`.
pub fn contact(number: u64, begin_s: i64) -> ContactMessage {
    ContactMessage {
        number,
        detector: "tauscope".to_owned(),
        kind: "contact".to_owned(),
        link: Some("link5".to_owned()),
        other_link: None,
        begin_ns: begin_s * 1_000_000_000,
        onset_ns: begin_s * 1_000_000_000 + 20_000_000,
        end_ns: None,
        peak_force_n: Some(24.0),
        latched: false,
        acknowledged_ns: None,
        acknowledged_by: None,
    }
}

/// A record of a contact.
pub fn record(instance: &str, number: u64, contact: ContactMessage) -> RecordMessage {
    RecordMessage {
        instance: instance.to_owned(),
        number,
        sent_ns: contact.onset_ns,
        record: Record::Contact(contact),
    }
}
