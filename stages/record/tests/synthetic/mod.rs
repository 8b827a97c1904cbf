//! A synthetic cell: an oscillating seven-joint arm that is pushed twice.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::f64::consts::TAU;
use std::fmt::Write as _;

use tauscope_bus::{
    Detection, Header, Health, JointState, SampleKind, SampleRef, Sink, TwinState, flags,
};
use tauscope_dynamics::{Data, Model, forward_kinematics, link_pose};
use tauscope_record::{CellInfo, Recorder, StreamInfo};

/// Time between two samples \[ns\].
pub const STEP_NS: i64 = 4_000_000;
/// Stamp of the first sample \[ns\].
pub const START_NS: i64 = 1_760_000_000_000_000_000;
/// Time at which the twin's filters have settled \[s\].
const SETTLED_S: f64 = 0.8;
/// Beginning \[s\], end \[s\] and relative strength of each push.
const PUSHES: [(f64, f64, f64); 2] = [(3.0, 4.2, 1.0), (7.0, 7.8, 0.6)];
/// The detector's threshold.
pub const THRESHOLD: f64 = 9.0;

/// A seven-joint arm of cylinders, or of meshes whose files do not exist.
pub fn arm(meshes: bool) -> Model {
    let joints = [
        ([0.0, 0.0, 0.333], 0.0),
        ([0.0, 0.0, 0.0], -TAU / 4.0),
        ([0.0, -0.316, 0.0], TAU / 4.0),
        ([0.0825, 0.0, 0.0], TAU / 4.0),
        ([-0.0825, 0.384, 0.0], -TAU / 4.0),
        ([0.0, 0.0, 0.0], TAU / 4.0),
        ([0.088, 0.0, 0.0], TAU / 4.0),
    ];
    let visual = |length: f64| {
        let shape = if meshes {
            r#"mesh filename="a.stl""#.to_owned()
        } else {
            format!(r#"cylinder radius="0.06" length="{length}""#)
        };
        format!("<visual><geometry><{shape}/></geometry></visual>")
    };
    let inertial = r#"<inertial><mass value="1"/>
        <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>"#;
    let mut urdf = format!(
        r#"<robot name="arm"><link name="link0">{}</link>"#,
        visual(0.3)
    );
    for (i, ([x, y, z], roll)) in joints.into_iter().enumerate() {
        let (parent, child) = (i, i + 1);
        write!(
            urdf,
            r#"<link name="link{child}">{inertial}{}</link>
            <joint name="joint{child}" type="revolute">
              <parent link="link{parent}"/><child link="link{child}"/>
              <origin xyz="{x} {y} {z}" rpy="{roll} 0 0"/><axis xyz="0 0 1"/>
              <limit lower="-3" upper="3" velocity="3" effort="100"/></joint>"#,
            visual(0.16)
        )
        .unwrap();
    }
    Model::from_urdf(&(urdf + "</robot>")).unwrap()
}

/// A cell with the arm, or with joint names only.
pub fn cell(name: &str, model: Option<Model>) -> CellInfo {
    CellInfo {
        name: name.to_owned(),
        joint_names: (1..=7).map(|i| format!("joint{i}")).collect(),
        model,
        effort_unit: "Nm".to_owned(),
    }
}

/// The typical three stages of a cell; their names end with `suffix`.
pub fn streams(cell: &str, suffix: &str) -> Vec<StreamInfo> {
    [
        ("ingest", SampleKind::JointState, None),
        ("twin", SampleKind::TwinState, None),
        (
            "detect",
            SampleKind::Detection,
            Some("twin_regression".to_owned()),
        ),
    ]
    .map(|(stage, kind, detector)| StreamInfo {
        stage: format!("{stage}{suffix}"),
        cell: cell.to_owned(),
        kind,
        detector,
        score_unit: "(N m)²".to_owned(),
    })
    .into()
}

/// All samples of an instant.
#[derive(Debug, Clone, Copy)]
pub struct Instant {
    pub state: JointState,
    pub twin: TwinState,
    pub detection: Detection,
    pub health: Option<Health>,
}

impl Instant {
    /// Passes them to the recorder, as from stages whose names end with `suffix`.
    pub fn feed(&self, recorder: &mut Recorder, suffix: &str) {
        let stage = |name: &str| format!("{name}{suffix}");
        recorder
            .accept(&stage("ingest"), SampleRef::JointState(&self.state))
            .unwrap();
        recorder
            .accept(&stage("twin"), SampleRef::TwinState(&self.twin))
            .unwrap();
        recorder
            .accept(&stage("detect"), SampleRef::Detection(&self.detection))
            .unwrap();
        if let Some(health) = &self.health {
            recorder
                .accept(&stage("twin"), SampleRef::Health(health))
                .unwrap();
        }
    }
}

/// Samples of the cell over a duration.
pub fn motion(seconds: f64) -> Vec<Instant> {
    let model = arm(false);
    let mut data = Data::new(&model);
    let mut onset_ns = None;
    let count = (seconds * 1e9) as i64 / STEP_NS;
    (0..count)
        .map(|k| instant(k, &model, &mut data, &mut onset_ns))
        .collect()
}

fn instant(k: i64, model: &Model, data: &mut Data, onset_ns: &mut Option<i64>) -> Instant {
    let t = (k * STEP_NS) as f64 * 1e-9;
    let header = Header {
        stamp_ns: START_NS + k * STEP_NS,
        received_ns: START_NS + k * STEP_NS + 300_000,
        sequence: k as u64,
        flags: flags::VELOCITY_MEASURED | flags::EFFORT_MEASURED,
        joint_count: 7,
    };
    let mut state = JointState {
        header,
        ..JointState::default()
    };
    let mut twin = TwinState {
        header,
        ..TwinState::default()
    };
    let push: f64 = PUSHES
        .iter()
        .filter(|(begin, end, _)| (*begin..*end).contains(&t))
        .map(|(begin, end, strength)| strength * ((t - begin) / (end - begin) * TAU / 2.0).sin())
        .sum();
    let rest = [0.0, -0.5, 0.0, -2.0, 0.0, 1.7, 0.7];
    let gravity = [0.0, -25.0, -3.0, 22.0, 1.0, 2.5, 0.1];
    let touch = [6.0, -9.0, 5.0, 8.0, -1.0, 0.5, 0.0];
    for j in 0..7 {
        let pulsation = TAU * (0.25 + 0.07 * j as f64);
        let amplitude = 0.5 - 0.04 * j as f64;
        state.position[j] = rest[j] + amplitude * (pulsation * t).sin();
        state.velocity[j] = amplitude * pulsation * (pulsation * t).cos();
        let friction = (4.0 - 0.4 * j as f64) * (8.0 * state.velocity[j]).tanh();
        let expected = gravity[j] * (1.0 + 0.2 * (pulsation * t).cos()) + friction;
        twin.expected_effort[j] = expected;
        // A deterministic substitute for noise.
        twin.residual[j] = push * touch[j] + 0.15 * (1e3 * t + j as f64).sin();
        state.effort[j] = expected + twin.residual[j];
    }
    (twin.position, twin.velocity, twin.effort) = (state.position, state.velocity, state.effort);
    let ready = t >= SETTLED_S;
    if ready {
        twin.header.flags |= flags::READY;
    }
    let score = twin.residual.iter().map(|r| r * r).sum();
    let mut detection = Detection {
        header: Header { flags: 0, ..header },
        detector: "twin_regression".into(),
        state: if ready {
            "free".into()
        } else {
            "not_ready".into()
        },
        score,
        threshold: THRESHOLD,
        ..Detection::default()
    };
    if ready {
        detection.header.flags |= flags::READY;
    }
    if ready && score >= THRESHOLD {
        forward_kinematics(model, data, &state.position[..7]);
        detection.event = if onset_ns.is_none() {
            Detection::ONSET
        } else {
            0
        };
        detection.header.flags |= flags::ALARM | flags::FORCE;
        detection.state = "contact".into();
        detection.link = "link5".into();
        detection.joints = 0b1111;
        detection.contact_ns = *onset_ns.get_or_insert(header.stamp_ns - 30_000_000);
        detection.force_n = [8.0, 22.0, -12.0].map(|newton| newton * push);
        detection.point_m = link_pose(model, data, 5).translation.vector.into();
    } else if onset_ns.take().is_some() {
        detection.event = Detection::OFFSET;
    }
    let health = (k % 250 == 0).then(|| Health {
        header,
        stage: "twin".into(),
        received: k as u64,
        emitted: k as u64,
        ..Health::default()
    });
    Instant {
        state,
        twin,
        detection,
        health,
    }
}
