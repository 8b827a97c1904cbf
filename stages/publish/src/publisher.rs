//! The publisher as a stage: it receives samples and updates the outputs of the cell.
//!
//! It never waits for a client. Zenoh drops messages that a subscriber is too slow for; a Modbus client reads the
//! newest status. Samples for which the publisher has no time are dropped by its link, which counts them. The alarm's
//! time is that of the samples; only the detection of silence uses a clock.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use tauscope_bus::{
    Command, Detection, Health, JointState, SampleKind, SampleRef, Sink, StageError, TwinState,
};
use tauscope_dynamics::Model;

use crate::alarm::Alarm;
use crate::config::{Config, ConfigError};
use crate::diagnostics::is_news;
use crate::error::PublishError;
use crate::fleet::Fleet;
use crate::message::{AlarmMessage, AlarmState, CommandMessage};
use crate::modbus::{Board, Commands, Modbus};
use crate::outputs::Outputs;
use crate::poses::Poses;
use crate::session::session;
use crate::setup::{Setup, StreamInfo};
use crate::status::Status;

/// Repetition interval of an unchanged alarm, in time of the samples \[ns\].
const REPEAT_NS: u64 = 100_000_000;
/// Repetition interval of an unchanged alarm in real time, while no sample arrives.
const REPEAT: Duration = Duration::from_millis(100);

/// A stream of detections.
struct Detector {
    stage: String,
    /// Unique label: the detector's name, or the stage's name if several stages run the same detector.
    label: String,
    /// Its index in the alarm.
    in_alarm: Option<usize>,
    before: Option<Detection>,
    heard: Option<Instant>,
}

/// Publishes the findings of the detectors to the cell. Not a safety function.
pub struct Publisher {
    cell: String,
    detectors: Vec<Detector>,
    alarm: Alarm,
    status: Status,
    poses: Option<Poses>,
    outputs: Option<Outputs>,
    fleet: Option<Fleet>,
    board: Board,
    modbus: Option<Modbus>,
    shown: Option<(AlarmMessage, Instant)>,
    /// Number of messages that could not be published.
    unsent: u64,
    /// Whether an upstream stage has failed.
    cut_short: bool,
}

impl Publisher {
    /// Opens the outputs in `config`.
    ///
    /// # Errors
    /// If configuration and streams do not match, or Zenoh or Modbus cannot be opened.
    pub fn new(config: &Config, setup: &Setup) -> Result<Self, PublishError> {
        config.check()?;
        let mut judges = 0;
        let detections = |stream: &&StreamInfo| stream.kind == SampleKind::Detection;
        let detectors = setup.streams.iter().filter(detections).map(|stream| {
            let in_alarm = stream.judges_contact.then(|| {
                judges += 1;
                judges - 1
            });
            Detector {
                stage: stream.stage.clone(),
                label: stream.label(&setup.streams),
                in_alarm,
                before: None,
                heard: None,
            }
        });
        let detectors: Vec<Detector> = detectors.collect();
        if judges == 0 {
            return Err(ConfigError::NoDetector.into());
        }
        let poses = setup.model.clone().map(Poses::new);
        let root = poses
            .as_ref()
            .and_then(Poses::root)
            .unwrap_or("world")
            .to_owned();
        let session = session(config, setup)?;
        let labels: Vec<&str> = detectors.iter().map(|each| each.label.as_str()).collect();
        let outputs = match (&session, &config.zenoh) {
            (Some(session), Some(zenoh)) => Some(Outputs::open(
                session,
                zenoh,
                &setup.cell,
                &setup.joint_names,
                &root,
                &labels,
            )?),
            _ => None,
        };
        let fleet = match (&session, &config.zenoh) {
            (Some(session), Some(zenoh)) if zenoh.fleet => Some(Fleet::open(
                session,
                &setup.cell,
                setup.model.as_ref().map_or("", Model::name),
                &setup.joint_names,
                detectors.len(),
                setup.facts.clone(),
                setup.commands.is_some(),
            )?),
            _ => None,
        };
        let (alarm, status) = before_all(config, judges, setup.restarted);
        let board = Board::new(status.clone());
        let commands = session
            .filter(|_| setup.commands.is_some())
            .map(|session| Commands {
                session,
                cell: setup.cell.clone(),
            });
        let modbus = config.modbus.as_ref();
        let modbus = modbus.map(|modbus| Modbus::serve(modbus, &board, commands));
        Ok(Self {
            cell: setup.cell.clone(),
            alarm,
            detectors,
            status,
            poses,
            outputs,
            fleet,
            board,
            modbus: modbus.transpose()?,
            shown: None,
            unsent: 0,
            cut_short: false,
        })
    }

    /// Returns the address that the Modbus server listens on.
    pub fn modbus_address(&self) -> Option<std::net::SocketAddr> {
        self.modbus.as_ref().map(Modbus::address)
    }

    fn joint_state(&mut self, sample: &JointState) {
        let stamp_ns = sample.header.stamp_ns;
        if let Some(poses) = &mut self.poses {
            poses.push(stamp_ns, &sample.position);
        }
        if sample.command.verb().is_some() {
            self.alarm.command(stamp_ns, sample.command);
            if let Some(fleet) = &mut self.fleet {
                fleet.command(stamp_ns, &sample.command);
            }
            let message = told(stamp_ns, &sample.command);
            self.tell(|outputs, _| outputs.command(&message));
        }
        if let Some(fleet) = &mut self.fleet {
            fleet.sample(stamp_ns);
        }
        self.tell(|outputs, _| outputs.joint_state(sample));
    }

    fn twin(&mut self, sample: &TwinState) {
        if let Some(poses) = &mut self.poses {
            poses.push(sample.header.stamp_ns, &sample.position);
        }
        if let Some(fleet) = &mut self.fleet {
            fleet.twin(sample);
        }
        self.tell(|outputs, _| outputs.twin(sample));
    }

    fn detection(&mut self, index: usize, detection: &Detection) {
        let detector = &mut self.detectors[index];
        let news = is_news(detector.before.as_ref(), detection);
        detector.before = Some(*detection);
        detector.heard = Some(Instant::now());
        if let Some(place) = detector.in_alarm {
            self.alarm.detection(place, detection);
            self.status.detections += 1;
        }
        // The alarm first, since the robot reacts to it; the rest is information for people.
        self.show();
        let label = self.detectors[index].label.clone();
        let judges = self.detectors[index].in_alarm.is_some();
        if let Some(fleet) = &mut self.fleet {
            fleet.sample(detection.header.stamp_ns);
            fleet.detection(index, &label, detection, judges, self.alarm.state());
        }
        self.tell(|outputs, poses| outputs.detection(detection, &label, news, poses));
    }

    fn health(&mut self, health: &Health) {
        if let Some(fleet) = &mut self.fleet {
            fleet.health(health);
        }
        self.tell(|outputs, _| outputs.health(health));
    }

    /// Updates the status, and publishes the alarm if needed.
    fn show(&mut self) {
        let judges = self.detectors.iter().filter(|each| each.in_alarm.is_some());
        let heard: Option<Vec<Instant>> = judges.clone().map(|each| each.heard).collect();
        self.status.heard = heard.and_then(|all| all.into_iter().min());
        let touched = judges
            .filter_map(|each| each.before.as_ref())
            .find(|detection| detection.alarm());
        let link = touched
            .map(|detection| detection.link.to_string())
            .filter(|link| !link.is_empty());
        let number = link
            .as_deref()
            .and_then(|link| self.poses.as_ref()?.link(link));
        self.status.link_number = number.map_or(0, |at| u16::try_from(at + 1).unwrap_or(u16::MAX));
        self.status.latch(self.alarm.state(), Instant::now());
        self.status.alarm = AlarmMessage {
            link,
            force_n: touched
                .filter(|detection| detection.header.has(tauscope_bus::flags::FORCE))
                .map(|detection| detection.force_n),
            ..of_alarm(&self.alarm)
        };
        self.board.show(&self.status);
        self.announce(Instant::now());
    }

    /// Publishes the alarm if it has changed, or if its last message is too old.
    fn announce(&mut self, now: Instant) {
        let alarm = self.status.at(now);
        let old = self.shown.as_ref().is_none_or(|(shown, since)| {
            let same = (
                shown.state,
                shown.free,
                shown.contact,
                shown.muted_s > 0.0,
                &shown.link,
            ) == (
                alarm.state,
                alarm.free,
                alarm.contact,
                alarm.muted_s > 0.0,
                &alarm.link,
            );
            let aged = alarm.stamp_ns.abs_diff(shown.stamp_ns) >= REPEAT_NS;
            !same || aged || now.saturating_duration_since(*since) >= REPEAT
        });
        if old {
            self.tell(|outputs, _| outputs.alarm(&alarm));
            self.shown = Some((alarm, now));
        }
    }

    /// Publishes over Zenoh, if configured. Failures are counted, and the first one is logged.
    fn tell(
        &mut self,
        publish: impl FnOnce(&mut Outputs, Option<&mut Poses>) -> Result<(), PublishError>,
    ) {
        let Some(outputs) = &mut self.outputs else {
            return;
        };
        let told = publish(outputs, self.poses.as_mut());
        self.note(told);
    }

    /// Reports news and the status to the fleet.
    fn tell_fleet(&mut self, now: Instant, ended: bool) {
        let Some(fleet) = &mut self.fleet else {
            return;
        };
        let told = fleet.tell(now, &self.status.at(now), self.unsent, ended);
        self.note(told);
    }

    fn note(&mut self, told: Result<(), PublishError>) {
        if let Err(error) = told {
            if self.unsent == 0 {
                tracing::warn!("{}: {error}; further ones are only counted", self.cell);
            }
            self.unsent += 1;
        }
    }
}

impl Sink for Publisher {
    fn accept(&mut self, from: &str, sample: SampleRef<'_>) -> Result<(), StageError> {
        match sample {
            SampleRef::JointState(sample) => self.joint_state(sample),
            SampleRef::TwinState(sample) => self.twin(sample),
            SampleRef::Detection(detection) => {
                let index = self.detectors.iter().position(|each| each.stage == from);
                let index = index.ok_or_else(|| {
                    StageError::failed(PublishError::UnknownStage {
                        stage: from.to_owned(),
                    })
                })?;
                self.detection(index, detection);
            }
            SampleRef::Health(health) => self.health(health),
        }
        // A detector may be silent while others send samples.
        let now = Instant::now();
        self.announce(now);
        self.tell_fleet(now, false);
        Ok(())
    }

    fn idle(&mut self) -> Result<(), StageError> {
        let now = Instant::now();
        self.announce(now);
        self.tell_fleet(now, false);
        Ok(())
    }

    fn cut_short(&mut self) {
        self.cut_short = true;
    }

    fn finish(&mut self) -> Result<(), StageError> {
        // The run is over: the state of the robot is unknown from here on.
        self.status.heard = None;
        self.board.show(&self.status);
        self.shown = None;
        let now = Instant::now();
        self.announce(now);
        self.tell_fleet(now, !self.cut_short);
        Ok(())
    }

    fn dropped(&self) -> u64 {
        self.unsent
    }
}

/// Creates the alarm of `judges` detectors, and the status before the first detection, with the latch after a
/// restart.
fn before_all(config: &Config, judges: usize, restarted: bool) -> (Alarm, Status) {
    let alarm = Alarm::new(config.latch, judges, restarted);
    let mut status = Status::silent(Duration::from_secs_f64(config.stop_after_s));
    status.latch(alarm.state(), Instant::now());
    status.alarm = of_alarm(&alarm);
    (alarm, status)
}

/// Returns the message of the alarm, without the touched link and the force.
fn of_alarm(alarm: &Alarm) -> AlarmMessage {
    AlarmMessage {
        stamp_ns: alarm.now_ns(),
        state: AlarmState::from(alarm.state()),
        free: alarm.is_free(),
        contact: alarm.in_contact(),
        muted_s: alarm.muted_s(),
        ..AlarmMessage::silent()
    }
}

fn told(stamp_ns: i64, command: &Command) -> CommandMessage {
    let arguments = command.arguments().into_iter();
    CommandMessage {
        stamp_ns,
        verb: command
            .verb()
            .map_or_else(String::new, |verb| verb.as_str().to_owned()),
        arguments: arguments
            .map(|(name, value)| (name.to_owned(), value))
            .collect::<BTreeMap<_, _>>(),
    }
}
