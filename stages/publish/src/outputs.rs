//! Outputs over Zenoh by topic: as JSON, and as ROS 2 messages. The topics are described in
//! `docs/publish.md`.

use tauscope_archive::ros::{self, Bool, DiagnosticArray, Float64, Wrench, WrenchStamped};
use tauscope_bus::{Detection, Health, JointState, Name, TwinState, flags};
use zenoh::Session;

use crate::config::ZenohConfig;
use crate::diagnostics;
use crate::error::PublishError;
use crate::json::Json;
use crate::message::{
    AlarmMessage, CommandMessage, DetectionMessage, EventMessage, HealthMessage, JointsMessage,
};
use crate::poses::Poses;
use crate::ros2::{Ros2, ros_name};

/// Publisher of the cell's messages.
pub(crate) struct Outputs {
    cell: String,
    joints: Vec<String>,
    /// The frame of the robot's root link, which is the world's.
    root: String,
    json: Option<Json>,
    ros2: Option<Ros2>,
}

impl Outputs {
    /// Announces the topics of a cell with these detectors.
    pub fn open(
        session: &Session,
        config: &ZenohConfig,
        cell: &str,
        joints: &[String],
        root: &str,
        detectors: &[&str],
    ) -> Result<Self, PublishError> {
        let ros2 = config.ros2.as_ref();
        let mut ros2 = ros2
            .map(|ros2| Ros2::open(session, ros2, cell))
            .transpose()?;
        if let Some(ros2) = &mut ros2 {
            ros2.announce::<Bool>("free")?;
            ros2.announce::<Bool>("contact")?;
            ros2.announce::<ros::JointState>("twin/joint_states")?;
            ros2.announce::<ros::JointState>("residual")?;
            ros2.announce::<DiagnosticArray>("detections")?;
            ros2.announce::<DiagnosticArray>("diagnostics")?;
            ros2.announce::<Float64>("external_force")?;
            ros2.announce::<WrenchStamped>("external_wrench")?;
            ros2.announce::<WrenchStamped>("contact_wrench")?;
            for label in detectors {
                ros2.announce::<Float64>(&score_topic(label))?;
            }
        }
        Ok(Self {
            cell: cell.to_owned(),
            joints: joints.to_vec(),
            root: root.to_owned(),
            json: config.json.then(|| Json::new(session, cell)),
            ros2,
        })
    }

    /// Publishes a measured state: as JSON only, since ROS 2 has it from the robot.
    pub fn joint_state(&mut self, sample: &JointState) -> Result<(), PublishError> {
        let Some(json) = &mut self.json else {
            return Ok(());
        };
        let count = self.joints.len();
        let given = |flag, values: &[f64]| {
            let count = if sample.header.has(flag) { count } else { 0 };
            values[..count].to_vec()
        };
        let message = JointsMessage {
            stamp_ns: sample.header.stamp_ns,
            sequence: sample.header.sequence,
            name: self.joints.clone(),
            position: sample.position[..count].to_vec(),
            velocity: given(flags::VELOCITY_MEASURED, &sample.velocity),
            effort: given(flags::EFFORT_MEASURED, &sample.effort),
        };
        json.publish("joint_states", &message)
    }

    /// Publishes the twin's effort and the residual.
    pub fn twin(&mut self, sample: &TwinState) -> Result<(), PublishError> {
        let count = self.joints.len();
        let both = [
            ("twin/joint_states", &sample.expected_effort, true),
            (
                "residual",
                &sample.residual,
                sample.header.has(flags::READY),
            ),
        ];
        for (topic, effort, valid) in both {
            if !valid {
                continue;
            }
            let message = JointsMessage {
                stamp_ns: sample.header.stamp_ns,
                sequence: sample.header.sequence,
                name: self.joints.clone(),
                effort: effort[..count].to_vec(),
                ..JointsMessage::default()
            };
            if let Some(json) = &mut self.json {
                json.publish(topic, &message)?;
            }
            if let Some(ros2) = &mut self.ros2 {
                let message = ros::JointState {
                    header: ros::Header::new(message.stamp_ns, ""),
                    name: message.name,
                    effort: message.effort,
                    ..ros::JointState::default()
                };
                ros2.publish(topic, &message)?;
            }
        }
        Ok(())
    }

    /// Publishes the state of the alarm.
    pub fn alarm(&mut self, alarm: &AlarmMessage) -> Result<(), PublishError> {
        if let Some(ros2) = &mut self.ros2 {
            ros2.publish("free", &Bool { data: alarm.free })?;
            ros2.publish(
                "contact",
                &Bool {
                    data: alarm.contact,
                },
            )?;
            ros2.publish("diagnostics", &diagnostics::of_alarm(alarm, &self.cell))?;
        }
        match &mut self.json {
            Some(json) => json.publish("alarm", alarm),
            None => Ok(()),
        }
    }

    /// Publishes a detection; `news` is whether something begins, ends or changes.
    pub fn detection(
        &mut self,
        detection: &Detection,
        label: &str,
        news: bool,
        poses: Option<&mut Poses>,
    ) -> Result<(), PublishError> {
        let message = detection_message(detection, &self.joints);
        if let Some(json) = &mut self.json {
            json.publish(&format!("detections/{label}"), &message)?;
        }
        let Some(ros2) = &mut self.ros2 else {
            return Ok(());
        };
        if news {
            let array = diagnostics::of_detection(&message, label, &self.cell);
            ros2.publish("detections", &array)?;
        }
        if message.ready {
            let score = Float64 {
                data: message.score,
            };
            ros2.publish(&score_topic(label), &score)?;
        }
        let Some(force) = message.force_n else {
            return Ok(());
        };
        let length = Float64 {
            data: force.iter().map(|f| f * f).sum::<f64>().sqrt(),
        };
        ros2.publish("external_force", &length)?;
        let wrench = |frame: &str, force: [f64; 3], torque: [f64; 3]| WrenchStamped {
            header: ros::Header::new(message.stamp_ns, frame),
            wrench: Wrench {
                force: force.into(),
                torque: torque.into(),
            },
        };
        let about_root =
            nalgebra::Vector3::from(detection.point_m).cross(&nalgebra::Vector3::from(force));
        ros2.publish(
            "external_wrench",
            &wrench(&self.root, force, about_root.into()),
        )?;
        let at_link = poses.and_then(|poses| poses.at_link(detection));
        if let (Some(link), Some(at_link)) = (&message.link, at_link) {
            let wrench = wrench(link, at_link.force_n, at_link.moment_nm);
            ros2.publish("contact_wrench", &wrench)?;
        }
        Ok(())
    }

    /// Publishes an accepted command.
    pub fn command(&mut self, command: &CommandMessage) -> Result<(), PublishError> {
        if let Some(ros2) = &mut self.ros2 {
            let array = diagnostics::of_command(command, &self.cell);
            ros2.publish("diagnostics", &array)?;
        }
        match &mut self.json {
            Some(json) => json.publish("command", command),
            None => Ok(()),
        }
    }

    /// Publishes the health of a stage.
    pub fn health(&mut self, health: &Health) -> Result<(), PublishError> {
        if let Some(ros2) = &mut self.ros2 {
            let array = diagnostics::of_health(health, &self.cell);
            ros2.publish("diagnostics", &array)?;
        }
        let Some(json) = &mut self.json else {
            return Ok(());
        };
        let message = HealthMessage::from(health);
        json.publish(&format!("health/{}", health.stage), &message)
    }
}

fn score_topic(label: &str) -> String {
    format!("detections/{}/score", ros_name(label))
}

fn detection_message(detection: &Detection, joints: &[String]) -> DetectionMessage {
    let header = &detection.header;
    let has_force = header.has(flags::FORCE);
    let told = |link: &Name| Some(link.to_string()).filter(|link| !link.is_empty());
    let loaded = |(place, name): (usize, &String)| {
        let is_loaded = detection.joints >> place & 1 == 1;
        is_loaded.then(|| name.clone())
    };
    DetectionMessage {
        stamp_ns: header.stamp_ns,
        sequence: header.sequence,
        detector: detection.detector.to_string(),
        state: detection.state.to_string(),
        ready: header.has(flags::READY),
        alarm: detection.alarm(),
        event: match detection.event {
            Detection::ONSET => Some(EventMessage::Onset),
            Detection::OFFSET => Some(EventMessage::Offset),
            _ => None,
        },
        score: detection.score,
        threshold: detection.threshold,
        contact_ns: detection.alarm().then_some(detection.contact_ns),
        joints: joints.iter().enumerate().filter_map(loaded).collect(),
        link: told(&detection.link),
        other_link: told(&detection.other_link),
        force_n: has_force.then_some(detection.force_n),
        point_m: has_force.then_some(detection.point_m),
    }
}
