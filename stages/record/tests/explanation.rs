//! The picture of an explanation can be read back for all kinds of findings.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use rerun::external::re_log_encoding::DecoderApp;
use rerun::log::{Chunk, LogMsg};
use tauscope_dynamics::Model;
use tauscope_record::{
    ExplainedEvent, ExplainedJoint, ExplainedRecording, ExplainedRobot, Explanation,
    write_explanation,
};

fn joint(name: &str, friction_nm: f64) -> ExplainedJoint {
    let time_s: Vec<f64> = (0..500).map(|i| f64::from(i) * 0.02).collect();
    let twin: Vec<f64> = time_s.iter().map(|t| 10.0 * (0.8 * t).sin()).collect();
    let corrected: Vec<f64> = time_s
        .iter()
        .zip(&twin)
        .map(|(t, twin)| twin + friction_nm * (0.8 * t).cos().signum())
        .collect();
    let measured = corrected
        .iter()
        .enumerate()
        .map(|(i, effort)| effort + 0.1 * (12.9 * i as f64).sin())
        .collect();
    ExplainedJoint {
        name: name.to_owned(),
        position: time_s.iter().map(|t| (0.8 * t).sin()).collect(),
        time_s,
        measured,
        twin,
        corrected,
    }
}

fn recording(name: &str, held_out: bool, start_ns: i64) -> ExplainedRecording {
    let joints = (1..=6).map(|j| joint(&format!("joint{j}"), f64::from(6 - j)));
    ExplainedRecording {
        name: name.to_owned(),
        held_out,
        start_ns,
        joints: joints.collect(),
    }
}

fn explanation() -> Explanation {
    let text_markdown = "# Explained\n\n**Five joints have Coulomb friction that the twin leaves out.**\n\n\
        1. **Coulomb friction, joint1**: 5.0 N m (4.9 to 5.1). Explains 41 % of the mismatch.\n\
        2. **Coulomb friction, joint2**: 4.0 N m (3.9 to 4.1). Explains 26 % of the mismatch.\n\n\
        | joint | before | after | noise |\n|---|---:|---:|---:|\n| joint1 | 5.0 | 0.07 | 0.07 |\n";
    Explanation {
        case: "cell 4".to_owned(),
        effort_unit: "Nm".to_owned(),
        text_markdown: text_markdown.to_owned(),
        recordings: vec![
            recording("rec_04", true, 1_700_000_060_000_000_000),
            recording("rec_00", false, 1_700_000_000_000_000_000),
        ],
        events: vec![
            ExplainedEvent {
                recording: None,
                start_s: 3.2,
                end_s: Some(6.8),
                label: "payload 1.9 kg".to_owned(),
                sentence: "The tool carries 1.9 kg until 6.8 s.".to_owned(),
            },
            ExplainedEvent {
                recording: Some("rec_00".to_owned()),
                start_s: 5.0,
                end_s: None,
                label: "friction step".to_owned(),
                sentence: "The friction of joint 2 rises and stays.".to_owned(),
            },
        ],
        robot: Some(ExplainedRobot {
            model: arm(),
            found: vec!["link3".to_owned()],
            ghost: vec![vec![0.1; 500]; 6],
        }),
    }
}

/// An arm of six cylinders.
fn arm() -> Model {
    let mut urdf = r#"<robot name="arm"><link name="link0"/>"#.to_owned();
    for child in 1..=6 {
        urdf += &format!(
            r#"<link name="link{child}"><inertial><mass value="1"/>
              <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
              <visual><geometry><cylinder radius="0.05" length="0.2"/></geometry></visual></link>
            <joint name="joint{child}" type="continuous"><parent link="link{}"/><child link="link{child}"/>
              <origin xyz="0 0 0.2"/><axis xyz="0 1 0"/></joint>"#,
            child - 1
        );
    }
    Model::from_urdf(&(urdf + "</robot>")).unwrap()
}

/// The chunks of the recording by entity, and the paths of the blueprint.
fn read(path: &Path) -> (BTreeMap<String, Vec<Chunk>>, BTreeSet<String>) {
    let reader = BufReader::new(File::open(path).unwrap());
    let (mut recording, mut blueprint) = (BTreeMap::<_, Vec<_>>::new(), BTreeSet::new());
    for message in DecoderApp::decode_eager(reader).unwrap() {
        let LogMsg::ArrowMsg(store, message) = message.unwrap() else {
            continue;
        };
        let chunk = Chunk::from_arrow_msg(&message).unwrap();
        let entity = chunk.entity_path().to_string();
        if store.is_blueprint() {
            blueprint.insert(entity);
        } else {
            recording.entry(entity).or_default().push(chunk);
        }
    }
    (recording, blueprint)
}

fn rows(chunks: &[Chunk]) -> usize {
    let moving = chunks.iter().filter(|chunk| !chunk.is_static());
    moving.map(Chunk::num_rows).sum()
}

#[test]
fn the_file_holds_efforts_residuals_events_text_and_layout() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/explain.rrd");
    write_explanation(&path, &explanation()).unwrap();
    assert!(!path.with_extension("rrd.part").exists());
    let (recording, blueprint) = read(&path);
    for name in ["rec_00", "rec_04"] {
        for joint in 1..=6 {
            for kind in ["effort", "residual"] {
                let chunks = &recording[&format!("/{name}/joint{joint}/{kind}")];
                assert_eq!(rows(chunks), 500, "{name} joint{joint} {kind}");
            }
        }
    }
    let chunk = recording["/rec_04/joint1/effort"]
        .iter()
        .find(|chunk| !chunk.is_static())
        .unwrap();
    let timelines: BTreeSet<_> = chunk.timelines().keys().map(ToString::to_string).collect();
    for name in [
        "message_log_time",
        "message_publish_time",
        "ros2_timestamp",
        "recording_time",
    ] {
        assert!(
            timelines.contains(name),
            "{name} is missing in {timelines:?}"
        );
    }
    assert!(recording["/explanation"][0].is_static());
    assert_eq!(rows(&recording["/rec_00/events/0"]), 3);
    assert_eq!(rows(&recording["/rec_00/events/1"]), 2);
    assert_eq!(rows(&recording["/rec_00/log"]), 2);
    assert!(!recording.contains_key("/rec_04/events/1"));
    assert!(blueprint.iter().any(|path| path.starts_with("/view/")));
    // Six links, every 20 ms, on the initial timeline of the picture.
    let moved = &recording["/transforms"];
    assert_eq!(rows(moved), 6 * 500);
    let moved = moved.iter().find(|chunk| !chunk.is_static()).unwrap();
    let times = moved.timelines()[&"recording_time".into()].times_raw();
    assert_eq!((times[0], times[6]), (0, 20_000_000));
    assert!(recording.contains_key("/robot/link6"));
    assert!(recording.contains_key("/uncorrected/robot/link6"));
    assert_eq!(rows(&recording["/uncorrected/transforms"]), 6 * 500);
    assert!(
        blueprint
            .iter()
            .any(|path| path.ends_with("/EyeControls3D"))
    );
}

#[test]
fn nothing_odd_keeps_it_from_being_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("explain.rrd");
    write_explanation(&path, &Explanation::default()).unwrap();
    assert!(read(&path).0.contains_key("/explanation"));

    let mut odd = explanation();
    odd.events[0].start_s = f64::NAN;
    odd.events[1].start_s = -3.0;
    odd.recordings[0].joints[0].time_s[3] = f64::NAN;
    odd.recordings[0].joints[1].corrected.clear();
    odd.recordings[0].joints[2].measured.fill(f64::NAN);
    odd.recordings[1].joints.clear();
    odd.recordings[1].name = "a b/c".to_owned();
    write_explanation(&path, &odd).unwrap();
    let (recording, _) = read(&path);
    assert_eq!(rows(&recording["/rec_04/joint1/effort"]), 499);
    assert_eq!(rows(&recording["/rec_04/joint2/effort"]), 0);
    assert_eq!(rows(&recording["/rec_04/joint3/residual"]), 500);
}
