//! The detector as a stage: twin states in, a verdict for each out.

use std::collections::BTreeMap;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_bus::{Detection, Emit, Name, Stage, StageError, TwinState, flags};
use tauscope_dynamics::Model;

use crate::config::{Config, ConfigError, Threshold};
use crate::frame::detector::Detector;
use crate::frame::events::{Alarm, OwnEvents, Step};
use crate::frame::isolation::Isolation;
use crate::frame::shared::Shared;
use crate::indri::virtual_collision_sensor::Learnt;
use crate::tajiri::learned::Trained;

/// What a detector must know of its cell and its twin.
#[derive(Debug, Clone, Default)]
pub struct Setup {
    /// By joint in URDF order.
    pub joints: Vec<JointSetup>,
    /// Their names: what was learnt by joint belongs to them.
    pub joint_names: Vec<String>,
    /// The robot, where there is one: for the touched link and the force.
    pub model: Option<Model>,
    /// By detector, what its score did on contact-free data.
    pub scores: BTreeMap<String, ScoreStatistics>,
    /// The link that holds the tool, an index into the model's links; else the model says which.
    pub tool_link: Option<usize>,
    /// The point of the tool that touches things, in that link's frame \[m\]; else its origin.
    pub contact_point_on_tool_m: Option<[f64; 3]>,
    /// The impedance that a Cartesian controller holds the tool with, where it is known.
    pub impedance: Option<Impedance>,
    /// By detector, those that were trained.
    pub trained: BTreeMap<String, Arc<Trained>>,
    /// What it shares with other detectors that are given the same samples; `None` shares nothing.
    pub shared: Option<Shared>,
}

impl Setup {
    /// What the score of `detector` does on contact-free data, as the twin says or else its training.
    pub fn statistics(&self, detector: &str) -> Option<ScoreStatistics> {
        let trained = || self.trained.get(detector).map(|trained| trained.score());
        self.scores.get(detector).copied().or_else(trained)
    }
}

/// What a Cartesian impedance controller holds the tool with (Salt Ducaju et al., equation 1).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Impedance {
    /// Translational stiffness \[N/m\].
    pub translational_n_per_m: f64,
    /// Rotational stiffness \[N m/rad\].
    pub rotational_nm_per_rad: f64,
}

/// What a detector must know of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointSetup {
    /// Gain that the twin applied \[effort unit per model unit\].
    pub gain: f64,
    /// Offset that the twin applied \[effort unit\].
    pub offset: f64,
    /// Standard deviation of the contact-free residual \[effort unit\], where known.
    pub noise: Option<f64>,
    /// How much the measured effort changes by 1 N m at the joint \[effort unit per N m\]; NaN where
    /// that is not known, and the joint tells nothing of a force.
    pub effort_per_nm: f64,
}

impl JointSetup {
    /// Whether its effort tells a torque.
    pub fn tells_torque(&self) -> bool {
        self.effort_per_nm.is_finite() && self.effort_per_nm != 0.0
    }
}

/// A detector's score on contact-free data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoreStatistics {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub standard_deviation: f64,
}

/// Who says when an alarm is raised.
enum Rule {
    /// A threshold on the score.
    Threshold(Alarm),
    /// The detector, from this score on.
    Own { threshold: f64, events: OwnEvents },
}

impl Rule {
    fn threshold(&self) -> f64 {
        match self {
            Self::Threshold(alarm) => alarm.threshold(),
            Self::Own { threshold, .. } => *threshold,
        }
    }
}

/// The detect stage: one detector and what all of them share.
pub struct Detect {
    detector: Box<dyn Detector>,
    name: Name,
    rule: Rule,
    isolation: Isolation,
}

impl Detect {
    /// The detector that `config` names, for a cell.
    ///
    /// # Errors
    /// If the configuration names no or several detectors, or no threshold can be had.
    pub fn new(config: &Config, setup: Setup) -> Result<Self, ConfigError> {
        let detector = config.detector(&setup)?;
        let rule = match detector.threshold() {
            Some(_) if config.threshold != Threshold::default() => {
                let detector = detector.name();
                return Err(ConfigError::OwnThreshold { detector });
            }
            Some(threshold) => Rule::Own {
                threshold,
                events: OwnEvents::default(),
            },
            None => {
                let threshold = config.threshold.resolve(detector.name(), &setup)?;
                // The usual range of the score: one standard deviation above its mean.
                let low = setup
                    .statistics(detector.name())
                    .map_or(0.5 * threshold, |score| {
                        score.mean + score.standard_deviation
                    });
                Rule::Threshold(Alarm::new(threshold, low, config.hold_s))
            }
        };
        Ok(Self {
            name: Name::new(detector.name()),
            detector,
            rule,
            isolation: Isolation::new(setup),
        })
    }

    /// What the detector has learnt while running, to be given to its next life; `None` if it learns
    /// nothing.
    pub fn learnt(&self) -> Option<Learnt> {
        self.detector.learnt()
    }
}

impl Stage<TwinState, Detection> for Detect {
    fn accept(
        &mut self,
        sample: &TwinState,
        out: &mut dyn Emit<Detection>,
    ) -> Result<(), StageError> {
        let judgement = self.detector.judge(sample);
        if let Some(fault) = self.detector.fault() {
            let detector = self.detector.name();
            return Err(StageError::Unfit(format!("{detector}: {fault}")));
        }
        let stamp_ns = sample.header.stamp_ns;
        let score = judgement.ready.then_some(judgement.score);
        let verdict = judgement.verdict.filter(|_| judgement.ready);
        let seen = verdict.and_then(|verdict| verdict.contact);
        let step = match &mut self.rule {
            Rule::Threshold(alarm) => alarm.step(stamp_ns, score),
            Rule::Own { events, .. } => events.step(
                verdict.map(|verdict| verdict.state),
                seen.map(|s| s.contact_ns),
            ),
        };
        let (usual, event, contact_ns) = match step {
            Step::Free => ("free", 0, None),
            Step::Onset { contact_ns } => ("contact", Detection::ONSET, Some(contact_ns)),
            Step::Contact { contact_ns } => ("contact", 0, Some(contact_ns)),
            Step::Offset => ("free", Detection::OFFSET, None),
        };
        let state = match verdict {
            Some(verdict) => verdict.state,
            None if judgement.ready || contact_ns.is_some() || event != 0 => usual,
            None => "not_ready",
        };
        let mut joints = 0;
        let mut contact = None;
        if contact_ns.is_some() {
            joints = seen
                .and_then(|seen| seen.joints)
                .unwrap_or_else(|| self.isolation.loaded_joints(&sample.residual));
            contact = seen
                .and_then(|seen| seen.place)
                .or_else(|| self.isolation.locate(sample));
        }
        let details = self.detector.details().filter(|_| judgement.ready);
        out.emit(&mut |slot| {
            slot.header = sample.header;
            slot.header.flags = sample.header.flags & flags::RESET;
            if judgement.ready {
                slot.header.flags |= flags::READY;
            }
            slot.detector = self.name;
            slot.state = Name::new(state);
            slot.score = judgement.score;
            slot.threshold = self.rule.threshold();
            slot.joints = joints;
            slot.event = event;
            if let Some(contact_ns) = contact_ns {
                slot.header.flags |= flags::ALARM;
                slot.contact_ns = contact_ns;
            }
            if let Some(contact) = contact {
                slot.header.flags |= flags::FORCE;
                slot.link = Name::new(self.isolation.link_name(contact.link));
                slot.force_n = contact.force_n;
                slot.point_m = contact.point_m;
            }
            if let Some(details) = details {
                slot.header.flags |= flags::CONTENT;
                slot.content_n = details.content_n;
                if let Some([rise, motion]) = details.directions {
                    slot.header.flags |= flags::DIRECTIONS;
                    slot.rise_direction = rise;
                    slot.motion_direction = motion;
                }
            }
        })?;
        Ok(())
    }
}
