//! Makes the inputs of the corpus that only tauscope's own types can make: archives, statuses and records.
//!
//!     cargo run -p tauscope-fuzz --example corpus

use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use tauscope_archive::ros::{self, Header, JointState};
use tauscope_archive::{Compression, McapWriter};
use tauscope_publish::message::{
    AlarmMessage, AlarmState, ContactMessage, HealthMessage, JointResidual, Record, RecordMessage,
    ResidualMessage, STATUS_VERSION, StatusMessage,
};

fn main() -> Result<(), Box<dyn Error>> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    for target in ["mcap", "status"] {
        fs::create_dir_all(corpus.join(target))?;
    }
    for (name, compression) in [("plain", Compression::None), ("lz4", Compression::Lz4)] {
        archive(&corpus.join("mcap").join(name), compression)?;
    }
    let keyed = |key: &str, message: String| format!("{key}\n{message}");
    let status_text = serde_json::to_string(&status())?;
    let records = serde_json::to_string(&[record(1), record(2)])?;
    let record = serde_json::to_string(&record(3))?;
    for (name, text) in [
        ("status", keyed("press-1/status", status_text)),
        ("record", keyed("press-1/records", record)),
        ("records", keyed("press-1/records", records)),
        ("token", keyed("press-1/@alive/7", String::new())),
    ] {
        fs::write(corpus.join("status").join(name), text)?;
    }
    Ok(())
}

fn archive(path: &Path, compression: Compression) -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let made: PathBuf = folder.path().join("a.mcap");
    let provenance = BTreeMap::from([("made_by".to_owned(), "an example".to_owned())]);
    let mut writer = McapWriter::create(&made, compression, &provenance)?;
    let topic = writer.add_topic::<JointState>("/joint_states")?;
    for k in 0..8 {
        let state = JointState {
            header: Header::new(k, "base"),
            name: vec!["shoulder".to_owned(), "elbow".to_owned()],
            position: vec![0.1, 0.2],
            velocity: vec![0.3, 0.4],
            effort: vec![5.0, 6.0],
        };
        writer.write(topic, k, k, &state)?;
    }
    let other = writer.add_topic::<ros::Float64>("/detections/a/threshold")?;
    writer.write(other, 9, 9, &ros::Float64 { data: 1.0 })?;
    fs::copy(writer.finish()?.path, path)?;
    Ok(())
}

fn contact() -> ContactMessage {
    ContactMessage {
        number: 1,
        detector: "tauscope".to_owned(),
        kind: "contact".to_owned(),
        link: Some("link5".to_owned()),
        other_link: Some("link4".to_owned()),
        begin_ns: 1_700_000_000_000_000_000,
        onset_ns: 1_700_000_000_020_000_000,
        end_ns: None,
        peak_force_n: Some(24.0),
        latched: false,
        acknowledged_ns: None,
        acknowledged_by: Some("anna".to_owned()),
    }
}

fn record(number: u64) -> RecordMessage {
    RecordMessage {
        instance: "7".to_owned(),
        number,
        sent_ns: 1_700_000_000_020_000_000,
        record: Record::Contact(contact()),
    }
}

fn status() -> StatusMessage {
    StatusMessage {
        version: STATUS_VERSION,
        instance: "7".to_owned(),
        sent_ns: 1_700_000_000_000_000_000,
        host: "cell-pc".to_owned(),
        tauscope: "0.1.0".to_owned(),
        robot: "demo_arm".to_owned(),
        effort_unit: "Nm".to_owned(),
        urdf_sha256: Some("ab".repeat(32)),
        twin_sha256: None,
        archive: Some("out/a-{n}.mcap".to_owned()),
        takes_commands: true,
        ended: false,
        alarm: AlarmMessage {
            stamp_ns: 1_700_000_000_000_000_000,
            state: AlarmState::Free,
            free: true,
            contact: false,
            muted_s: 0.0,
            latched_for_ms: None,
            link: None,
            force_n: None,
        },
        last_sample_ns: Some(1_700_000_000_000_000_000),
        last_sample_age_ms: Some(2),
        contacts_today: 1,
        contacts_since_ns: 0,
        last_contact: Some(contact()),
        last_record: 1,
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
            stamp_ns: 1_700_000_000_000_000_000,
            window_s: 60.0,
            joints: vec![JointResidual {
                name: "joint1".to_owned(),
                rms: 0.5,
                mean: 0.1,
                calibrated: Some(0.5),
            }],
        }),
        changes: Vec::new(),
    }
}
