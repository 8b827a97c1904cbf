//! Live joint states of a Universal Robots controller over RTDE, without ROS.
//!
//! A thread receives the controller's packages and puts them into a bounded queue, which drops the oldest when full.
//! Packing is done by the thread that requests samples.

mod clock;
mod connection;
mod fault;
mod field;
mod recipe;
mod wire;

use std::sync::Arc;
use std::task::Waker;
use std::time::Duration;

use tauscope_archive::ros;
use tauscope_bus::{Emit, JointState, Progress, Source, StageError, Trouble};

use tauscope_session::Counts;

use crate::config::{Config, ConfigError, UrRtdeConfig};
use crate::error::IngestError;
use crate::pack::{PackSettings, Packer};
use crate::setup::Setup;
use clock::Clock;
use connection::{Data, Shared, now_ns};
use field::{JOINTS, Part};

/// Longest wait of a sample for its other parts \[ns\]: none, since all parts come in one package.
const WAIT_NS: i64 = 0;
/// Maximum number of packages per step.
/// Resolution: latency of a stop, against the cost of a step.
const PACKAGES_PER_STEP: usize = 64;
/// Silence after which a fault is reported.
const SILENT_AFTER: Duration = Duration::from_secs(1);
/// Time within which the first attempt to connect ends.
const CONNECTED_WITHIN: Duration = Duration::from_secs(3);

/// A source that reads from a controller. It has no end; it resumes when a lost controller reconnects.
#[derive(Debug)]
pub struct UrRtdeSource {
    settings: UrRtdeConfig,
    shared: Arc<Shared>,
    clock: Clock,
    packer: Packer,
    message: ros::JointState,
    reference: ros::JointState,
    tool: Option<ros::Inertia>,
    timeless: u64,
}

impl UrRtdeSource {
    /// Starts connecting. The controller need not be reachable yet.
    ///
    /// # Errors
    /// If the arm's six joints are not those of the cell, or a payload has no link to attach to.
    pub fn open(
        settings: &UrRtdeConfig,
        config: &Config,
        setup: &Setup,
    ) -> Result<Self, IngestError> {
        let name = joint_names(settings, setup)?;
        let pack = PackSettings {
            velocity_cutoff_hz: config.velocity_cutoff_hz,
            max_age_ns: (config.max_age_s * 1e9) as i64,
            wait_ns: WAIT_NS,
            expects_command: false,
            expects_reference: settings.target_moment,
        };
        let message = ros::JointState {
            name,
            ..ros::JointState::default()
        };
        Ok(Self {
            packer: Packer::new(setup, pack)?,
            shared: connection::start(settings).map_err(IngestError::Thread)?,
            settings: settings.clone(),
            clock: Clock::new(settings.rate_hz),
            reference: message.clone(),
            message,
            tool: None,
            timeless: 0,
        })
    }

    /// Returns the number of packages that the controller skipped or that were lost during a disconnection.
    pub fn lost(&self) -> u64 {
        self.clock.lost()
    }

    /// Returns the counts of packed and refused messages.
    pub fn pack_counts(&self) -> Counts {
        self.packer.counts()
    }

    fn take(&mut self, data: &Data) {
        let of = |part: Part| &data.numbers[part.place()];
        let received_ns = data.received_ns;
        let timestamp_s = of(Part::Timestamp)[0];
        let Some(stamp_ns) = self.clock.stamp(timestamp_s, received_ns, data.connection) else {
            self.timeless += 1;
            return;
        };
        let header = ros::Header::new(stamp_ns, "");
        let fill = |values: &mut Vec<f64>, part| {
            values.clear();
            values.extend_from_slice(of(part));
        };
        if self.settings.target_moment {
            self.reference.header.clone_from(&header);
            fill(&mut self.reference.effort, Part::TargetMoment);
            self.packer.reference(&self.reference, received_ns);
        }
        if self.settings.payload {
            self.attach(data, &header);
        }
        self.message.header = header;
        fill(&mut self.message.position, Part::Position);
        fill(&mut self.message.velocity, Part::Velocity);
        fill(&mut self.message.effort, Part::Effort);
        self.packer.state(&self.message, received_ns);
        if let Some(refused) = self.packer.newly_refused(received_ns) {
            tracing::warn!("{}: {refused}", self.settings.host);
        }
    }

    /// Reports the payload to the packer when it changes.
    fn attach(&mut self, data: &Data, header: &ros::Header) {
        let of = |part: Part| &data.numbers[part.place()];
        let (com, inertia) = (of(Part::CentreOfMass), of(Part::Inertia));
        let mut tool = ros::Inertia {
            m: of(Part::Mass)[0],
            com: ros::Vector3::from([com[0], com[1], com[2]]),
            ..ros::Inertia::default()
        };
        if data.has_inertia {
            // Universal Robots' order: the diagonal first.
            [tool.ixx, tool.iyy, tool.izz] = [inertia[0], inertia[1], inertia[2]];
            [tool.ixy, tool.ixz, tool.iyz] = [inertia[3], inertia[4], inertia[5]];
        }
        if self.tool == Some(tool) {
            return;
        }
        self.tool = Some(tool);
        let message = ros::InertiaStamped {
            header: header.clone(),
            inertia: tool,
        };
        self.packer.tool(&message, data.received_ns);
    }
}

impl Drop for UrRtdeSource {
    fn drop(&mut self) {
        self.shared.stop();
    }
}

impl Source<JointState> for UrRtdeSource {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        let mut progress = Progress::Idle;
        for _ in 0..PACKAGES_PER_STEP {
            let Some(data) = self.shared.queue.pop() else {
                return Ok(progress);
            };
            self.take(&data);
            while let Some(sample) = self.packer.pop(now_ns()) {
                out.emit(&mut |slot| *slot = sample)?;
                progress = Progress::More;
            }
        }
        Ok(Progress::More)
    }

    fn register(&mut self, waker: &Waker) -> bool {
        self.shared.queue.register(waker);
        true
    }

    fn dropped(&self) -> u64 {
        // The clock also counts packages dropped by the queue, since they leave a gap in the controller's time.
        self.packer.counts().dropped() + self.timeless + self.clock.lost()
    }

    fn trouble(&mut self, silent_for: Duration) -> Option<Trouble> {
        if silent_for < SILENT_AFTER {
            return None;
        }
        let counts = self.packer.counts();
        if let Some(fault) = self.shared.fault() {
            return Some(fault.trouble(&self.settings, counts.packed > 0));
        }
        let address = self.settings.address();
        if let Some((joint, field)) = self.packer.never_finite() {
            let title = format!("the controller {address} has no {field} of joint `{joint}`");
            return Some(Trouble::new(title));
        }
        if counts.repeated + counts.late + self.timeless > 0 {
            let title = format!("the time of the controller {address} does not advance");
            let likely = "the controller has stopped: look at its screen";
            return Some(Trouble::new(title).likely(Some(likely.to_owned())));
        }
        (silent_for > CONNECTED_WITHIN)
            .then(|| Trouble::new(format!("the controller {address} has not been reached yet")))
    }
}

/// Returns the names of the six joints, from base to wrist.
fn joint_names(settings: &UrRtdeConfig, setup: &Setup) -> Result<Vec<String>, ConfigError> {
    let names = settings.joints.as_ref().unwrap_or(&setup.joint_names);
    if names.len() != JOINTS {
        return Err(ConfigError::UrJoints { found: names.len() });
    }
    let unnamed = |joint: &&String| !names.contains(joint);
    if let Some(joint) = setup.joint_names.iter().find(unnamed) {
        return Err(ConfigError::UrJointUnnamed {
            joint: joint.clone(),
        });
    }
    if settings.payload && !setup.has_tool_link {
        return Err(ConfigError::UrPayload);
    }
    Ok(names.clone())
}
