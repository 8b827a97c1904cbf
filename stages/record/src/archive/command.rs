//! Topics for the other content of a joint state: commanded motion, tool, requests to learn, and commands to the
//! pipeline. With them a replay of the archive equals the recorded run. They are written on change. A constant
//! commanded motion is repeated, because a source ignores an old one.

use tauscope_archive::ros::{self, DiagnosticArray, Inertia, InertiaStamped, Level};
use tauscope_archive::{TopicWriter, WriteError};
use tauscope_bus::{JointArray, JointState, flags};

use super::File;
use super::joints::{JointTopic, status};
use crate::streams::{Stream, Streams};

/// Topics of commands, tool and requests, created with their first message.
pub(super) struct CommandTopics {
    joints: Vec<String>,
    command_name: String,
    command: Option<JointTopic>,
    newest: Option<Command>,
    newest_ns: i64,
    tool_name: String,
    tool: Option<TopicWriter<InertiaStamped>>,
    attached: Option<Tool>,
    learn_name: String,
    learn: Option<TopicWriter<ros::Bool>>,
    told_name: String,
    told: Option<TopicWriter<DiagnosticArray>>,
    cell: String,
}

/// Repetition period of an unchanged command \[ns\].
/// Resolution: size of the archive, against how soon a late reader sees the command.
const REPEAT_NS: u64 = 100_000_000;

/// Commanded position, and velocity if given.
type Command = (JointArray, Option<JointArray>);

/// Mass, centre of mass and inertia.
type Tool = (f64, [f64; 3], [f64; 6]);

impl CommandTopics {
    pub fn new(streams: &Streams, stream: &Stream) -> Self {
        let prefix = streams.prefix(stream.cell);
        let suffix = stream.topic[prefix.len()..].trim_start_matches("/joint_states");
        Self {
            joints: streams.cells[stream.cell].joint_names.clone(),
            command_name: format!("{prefix}/joint_commands{suffix}"),
            command: None,
            newest: None,
            newest_ns: 0,
            tool_name: format!("{prefix}/tool{suffix}"),
            tool: None,
            attached: None,
            learn_name: format!("{prefix}/learn{suffix}"),
            learn: None,
            told_name: format!("{prefix}/commands{suffix}"),
            told: None,
            cell: streams.cells[stream.cell].name.clone(),
        }
    }

    /// Writes what must precede the state: a request to learn or a command applies from the following state on.
    pub fn write_ahead(&mut self, file: &mut File, sample: &JointState) -> Result<(), WriteError> {
        if let Some(verb) = sample.command.verb() {
            let arguments = sample.command.arguments();
            let words: Vec<&str> = arguments.iter().map(|(_, value)| value.as_str()).collect();
            let words = format!("{} {}", verb.as_str(), words.join(" "));
            let array = DiagnosticArray {
                header: ros::Header::new(sample.header.stamp_ns, ""),
                status: vec![status(
                    Level::Ok,
                    verb.as_str(),
                    words.trim_end().to_owned(),
                    &self.cell,
                    arguments,
                )],
            };
            let name = || self.told_name.clone();
            file.write_late(&mut self.told, name, &sample.header, &array)?;
        }
        if sample.header.has(flags::LEARN) {
            let asked = ros::Bool { data: true };
            let name = || self.learn_name.clone();
            file.write_late(&mut self.learn, name, &sample.header, &asked)?;
        }
        Ok(())
    }

    /// Writes what may follow the state.
    pub fn write(&mut self, file: &mut File, sample: &JointState) -> Result<(), WriteError> {
        let header = &sample.header;
        if header.has(flags::COMMAND) {
            let velocity = header
                .has(flags::COMMAND_VELOCITY)
                .then_some(sample.command_velocity);
            let command = (sample.command_position, velocity);
            let old = header.stamp_ns.abs_diff(self.newest_ns) >= REPEAT_NS;
            if self.newest != Some(command) || old {
                let topic = match &mut self.command {
                    Some(topic) => topic,
                    none => {
                        none.insert(JointTopic::new(file.add(&self.command_name)?, &self.joints))
                    }
                };
                topic.write(file, header, Some(&command.0), command.1.as_ref(), None)?;
                self.newest = Some(command);
                self.newest_ns = header.stamp_ns;
            }
        }
        let tool = header.has(flags::TOOL).then_some((
            sample.tool_mass_kg,
            sample.tool_com_m,
            sample.tool_inertia_kgm2,
        ));
        if tool != self.attached {
            self.attached = tool;
            let (m, com, [ixx, ixy, ixz, iyy, iyz, izz]) = tool.unwrap_or_default();
            let com = com.into();
            let message = InertiaStamped {
                header: ros::Header::new(header.stamp_ns, ""),
                inertia: Inertia {
                    m,
                    com,
                    ixx,
                    ixy,
                    ixz,
                    iyy,
                    iyz,
                    izz,
                },
            };
            file.write_late(&mut self.tool, || self.tool_name.clone(), header, &message)?;
        }
        Ok(())
    }
}
