//! Live joint states over Zenoh: ROS 2 nodes with `rmw_zenoh`, nodes behind `zenoh-bridge-ros2dds`, or
//! tauscope's own keys.
//!
//! A subscriber only puts bytes into a bounded queue, which drops the oldest when full. Decoding and packing
//! are done by the thread that requests samples.

mod attachment;
mod diagnosis;
mod frozen;
mod joint_names;
mod keys;
mod publication;
mod rivals;
mod scout;
mod waiting;
mod watch;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::task::Waker;
use std::time::{Duration, Instant, SystemTime};

use tauscope_archive::ros::{self, Message};
use tauscope_bus::{Emit, JointState, Progress, Source, StageError, Trouble, flags, zenoh_reason};
use tauscope_session::Counts;
use zenoh::{Session, Wait};

use crate::config::{Config, ConfigError, ZenohConfig};
use crate::error::IngestError;
use crate::pack::{PackSettings, Packer};
use crate::queue::Queue;
use crate::setup::Setup;
use attachment::{Attachment, Losses};
use diagnosis::Expected;
use keys::KeyScheme;
use rivals::Rivals;
use waiting::{Role, Waiting};
use watch::Watch;

/// Longest wait of a sample for the command of its instant \[ns\].
/// Chosen: a few samples at 500 Hz; longer would delay each sample without a command by as much.
const WAIT_NS: i64 = 10_000_000;
/// Time to the next step while a sample waits for its command.
/// Resolution: the delay of a sample without a command, against the number of wake-ups.
const SHORTEST_WAIT: Duration = Duration::from_millis(2);
/// Maximum number of messages per step.
/// Resolution: latency of a stop, against the cost of a step.
const MESSAGES_PER_STEP: usize = 64;
/// Maximum size of a message; a joint state of sixteen joints has 1 kB.
/// Resolution: memory; 64 times the largest joint state.
const MAX_PAYLOAD_BYTES: usize = 65_536;

/// Message counts of a [`ZenohSource`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ZenohCounts {
    /// Received messages.
    pub received: u64,
    /// Messages that the queue dropped because the pipeline was busy.
    pub overflowed: u64,
    /// Messages lost in transport: gaps in the publishers' sequence numbers.
    pub lost: u64,
    /// Messages that cannot be decoded as their topic's type.
    pub undecodable: u64,
    /// States of a second publisher of the same joints.
    pub rival: u64,
}

/// A source that subscribes. It has no end; it resumes when a lost publisher returns.
pub struct ZenohSource {
    /// Keeps the subscriptions alive.
    session: Session,
    queue: Arc<Queue<Waiting>>,
    packer: Packer,
    losses: Losses,
    rivals: Rivals,
    hashes: keys::HashWatch,
    message: ros::JointState,
    /// Decoders by role, because each topic has its own type.
    decoders: BTreeMap<Role, ros::JointStateDecoder>,
    tool: ros::InertiaStamped,
    learn: ros::Bool,
    counts: ZenohCounts,
    watch: Watch,
}

impl std::fmt::Debug for ZenohSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ZenohSource")
            .field("counts", &self.counts())
            .finish_non_exhaustive()
    }
}

impl ZenohSource {
    /// Opens a session and subscribes. Endpoints to connect to need not be reachable yet.
    ///
    /// # Errors
    /// If an endpoint or key is invalid, no endpoint is given, or an endpoint cannot be listened on.
    pub fn open(zenoh: &ZenohConfig, config: &Config, setup: &Setup) -> Result<Self, IngestError> {
        let session = zenoh::open(session_config(zenoh)?)
            .wait()
            .map_err(|error| IngestError::Zenoh(zenoh_reason(&error)))?;
        let queue = Arc::new(Queue::new(zenoh.queue));
        let scheme = KeyScheme::new(zenoh, &setup.cell);
        let topics = &zenoh.topics;
        let named = [
            (Some(&topics.state), Role::State),
            (topics.command.as_ref(), Role::Command),
            (topics.twin.as_ref(), Role::Reference),
            (topics.tool.as_ref(), Role::Tool),
            (topics.learn.as_ref(), Role::Learn),
        ];
        for (topic, role) in named {
            let Some(topic) = topic else { continue };
            let only = match role {
                Role::Tool => Some(ros::InertiaStamped::dds_type()),
                Role::Learn => Some(ros::Bool::dds_type()),
                Role::State | Role::Command | Role::Reference => None,
            };
            if let Some(dds_type) = only {
                subscribe(
                    &session,
                    &scheme.key(topic, &dds_type),
                    (role, None),
                    &queue,
                )?;
                continue;
            }
            for (key, of) in scheme.joint_state_keys(topic) {
                subscribe(&session, &key, (role, of), &queue)?;
            }
        }
        let settings = PackSettings {
            velocity_cutoff_hz: config.velocity_cutoff_hz,
            max_age_ns: (config.max_age_s * 1e9) as i64,
            wait_ns: WAIT_NS,
            expects_command: topics.command.is_some(),
            expects_reference: topics.twin.is_some(),
        };
        Ok(Self {
            session,
            queue,
            packer: Packer::new(setup, settings)?,
            losses: Losses::default(),
            rivals: Rivals::default(),
            hashes: keys::HashWatch::new(&scheme),
            message: ros::JointState::default(),
            decoders: BTreeMap::new(),
            tool: ros::InertiaStamped::default(),
            learn: ros::Bool::default(),
            counts: ZenohCounts::default(),
            watch: Watch::new(Expected {
                scheme,
                topic: topics.state.clone(),
                joints: setup.joint_names.clone(),
                connect: zenoh.connect.clone(),
                listen: zenoh.listen.clone(),
            }),
        })
    }

    /// Returns the counts of received messages.
    pub fn counts(&self) -> ZenohCounts {
        ZenohCounts {
            overflowed: self.queue.overflowed(),
            lost: self.losses.lost(),
            rival: self.rivals.refused(),
            ..self.counts
        }
    }

    /// Returns the counts of packed and refused messages.
    pub fn pack_counts(&self) -> Counts {
        self.packer.counts()
    }

    /// Whether the session is connected to a router or peer.
    pub fn is_connected(&self) -> bool {
        scout::connected(&self.session) > 0
    }

    /// Decodes a message into the buffer of its role.
    fn decode(&mut self, waiting: &Waiting, payload: &[u8]) -> Result<(), ros::DecodeError> {
        let (hash, decoded) = match waiting.role {
            Role::Tool => (
                ros::InertiaStamped::TYPE_HASH,
                ros::decode_into(payload, &mut self.tool),
            ),
            Role::Learn => (
                ros::Bool::TYPE_HASH,
                ros::decode_into(payload, &mut self.learn),
            ),
            role @ (Role::State | Role::Command | Role::Reference) => {
                let decoder = self.decoders.entry(role).or_default();
                let Some(of) = waiting.joint_state_type else {
                    return decoder.guess_into(payload, &mut self.message).map(|_| ());
                };
                (
                    of.hash(),
                    decoder.decode_into(of, payload, &mut self.message),
                )
            }
        };
        self.hashes.compare(&waiting.key, hash);
        decoded
    }

    fn take(&mut self, waiting: &Waiting) {
        self.counts.received += 1;
        if let Some(attachment) = waiting.attachment {
            self.losses.count(waiting.role, attachment);
        }
        let payload = waiting.payload.to_bytes();
        let decoded = if payload.len() > MAX_PAYLOAD_BYTES {
            Err(format!("{} bytes are too many", payload.len()))
        } else {
            self.decode(waiting, &payload)
                .map_err(|error| error.to_string())
        };
        if waiting.role == Role::State {
            self.watch.state(decoded.as_ref().err().map(String::as_str));
        }
        if let Err(reason) = decoded {
            if self.counts.undecodable == 0 {
                tracing::warn!("{}: {reason}; further ones are only counted", waiting.key);
            }
            self.counts.undecodable += 1;
            return;
        }
        let (packer, received_ns) = (&mut self.packer, waiting.received_ns);
        match waiting.role {
            Role::State => {
                let joints = packer.joints_of(&self.message);
                let publisher = waiting.attachment.map(|attachment| attachment.publisher);
                if publisher.is_none_or(|it| self.rivals.admits(it, joints, received_ns)) {
                    packer.state(&self.message, received_ns);
                }
            }
            Role::Command => packer.command(&self.message, received_ns),
            Role::Reference => packer.reference(&self.message, received_ns),
            Role::Tool => packer.tool(&self.tool, received_ns),
            Role::Learn => packer.learn(self.learn),
        }
        if let Some(refused) = packer.newly_refused(received_ns) {
            tracing::warn!("{}: {refused}", waiting.key);
        }
    }
}

impl Source<JointState> for ZenohSource {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        let mut progress = Progress::Idle;
        for _ in 0..MESSAGES_PER_STEP {
            let waiting = self.queue.pop();
            if let Some(waiting) = &waiting {
                self.take(waiting);
            }
            while let Some(mut sample) = self.packer.pop(now_ns()) {
                self.watch.sample(&sample, self.packer.counts());
                if self.watch.is_frozen() {
                    // A repeated measurement is not current: no detector may judge it, nor report the robot free.
                    sample.header.flags &= !flags::EFFORT_MEASURED;
                    sample.effort = JointState::default().effort;
                }
                out.emit(&mut |slot| *slot = sample)?;
                progress = Progress::More;
            }
            if waiting.is_none() {
                return Ok(match progress {
                    Progress::Idle if self.packer.is_waiting() => {
                        Progress::Until(Instant::now() + SHORTEST_WAIT)
                    }
                    progress => progress,
                });
            }
        }
        Ok(Progress::More)
    }

    fn register(&mut self, waker: &Waker) -> bool {
        self.queue.register(waker);
        true
    }

    fn dropped(&self) -> u64 {
        let counts = self.counts();
        // A message dropped by the queue also leaves a gap in the sequence numbers, if the publisher has any.
        let packed = self.packer.counts();
        packed.dropped() + counts.undecodable + counts.rival + counts.overflowed.max(counts.lost)
    }

    fn trouble(&mut self, silent_for: Duration) -> Option<Trouble> {
        let trouble = self.watch.trouble(silent_for, &self.session, &self.packer);
        trouble.or_else(|| self.rivals.are_there(now_ns()).then(|| self.watch.rivals()))
    }
}

/// Returns the current time on the clock of reception.
fn now_ns() -> i64 {
    SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .map_or(0, |since| since.as_nanos() as i64)
}

fn subscribe(
    session: &Session,
    key: &str,
    (role, joint_state_type): (Role, Option<ros::JointStateType>),
    queue: &Arc<Queue<Waiting>>,
) -> Result<(), IngestError> {
    let queue = Arc::clone(queue);
    session
        .declare_subscriber(key.to_owned())
        .callback(move |sample| {
            let attachment = sample
                .attachment()
                .and_then(|bytes| Attachment::parse(&bytes.to_bytes()));
            queue.push(Waiting {
                role,
                joint_state_type,
                received_ns: now_ns(),
                key: sample.key_expr().clone().into_owned(),
                payload: sample.payload().clone(),
                attachment,
            });
        })
        .background()
        .wait()
        .map_err(|error| {
            ConfigError::Zenoh {
                what: "key",
                text: key.to_owned(),
                reason: zenoh_reason(&error),
            }
            .into()
        })
}

/// Configures a session that uses only the given endpoints and retries them without limit.
fn session_config(zenoh: &ZenohConfig) -> Result<zenoh::Config, ConfigError> {
    if zenoh.connect.is_empty() && zenoh.listen.is_empty() {
        return Err(ConfigError::NoEndpoint);
    }
    let mut config = zenoh::Config::default();
    let list = |endpoints: &[String]| serde_json::Value::from(endpoints).to_string();
    let settings = [
        // Sessions of rmw_zenoh are peers. A router forwards their messages to routers and clients, but not to other
        // peers. A client cannot start before its router is reachable.
        ("mode", "\"router\"".to_owned()),
        ("connect/endpoints", list(&zenoh.connect)),
        ("listen/endpoints", list(&zenoh.listen)),
        ("connect/timeout_ms", "-1".to_owned()),
        ("connect/exit_on_failure", "false".to_owned()),
        (
            "connect/retry",
            "{period_init_ms: 200, period_max_ms: 2000, period_increase_factor: 2}".to_owned(),
        ),
        ("listen/timeout_ms", "0".to_owned()),
        ("listen/exit_on_failure", "true".to_owned()),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "false".to_owned()),
        ("transport/shared_memory/enabled", "false".to_owned()),
    ];
    for (key, value) in settings {
        config
            .insert_json5(key, &value)
            .map_err(|error| ConfigError::Zenoh {
                what: if key.ends_with("endpoints") {
                    "endpoints"
                } else {
                    "setting"
                },
                text: format!("{key}: {value}"),
                reason: zenoh_reason(&error),
            })?;
    }
    Ok(config)
}
