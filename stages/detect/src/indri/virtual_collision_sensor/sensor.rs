//! The complete sensor: the blocks of all joints (section 5), the request for learning, and the common alarm.

use tauscope_bus::{MAX_JOINTS, TwinState, flags};
use tauscope_dynamics::lowpass::Butterworth2;

use super::bias::{Bias, LearningState, Service};
use super::blocks::Blocks;
use super::joint::{Currents, Joint, Reading, Tuning};
use super::learnt::Learnt;
use super::lessons::AFTER_CONTACT_NS;
use super::model_error::BUFFER_S;
use super::validity::Validity;
use crate::frame::{Detector, Judgement, Seen, Shared, State, Tap, Verdict};

/// Ratio from which a sample may already belong to a collision: the search for the collision's start stops below it.
/// Tuned: on the practice set of cyclic moves (docs/papers.md); not swept.
const LOW_RATIO: f64 = 0.5;

/// Time after an alarm without learning, because the model error still contains the collision \[ns\].
/// Derived: an arm swings for [`AFTER_CONTACT_NS`], and the buffer of the model error holds the swing for
/// [`BUFFER_S`].
const AFTER_ALARM_NS: i64 = AFTER_CONTACT_NS + (BUFFER_S * 1e9) as i64;

/// State without an alarm.
const FREE: &str = "free";
/// State without an alarm during learning.
const LEARNING: &str = "learning";
/// State during a collision.
const COLLISION: &str = "collision";
/// State during an alarm that is not a collision: the expected current does not fit the robot's current condition.
const MODEL_ERROR: &str = "model_error";

/// Learning settings of the adaptive version; the basic one does not learn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Learning {
    /// Duration of learning \[s\].
    pub duration_s: f64,
    /// Whether learning starts at the first sample.
    pub at_start: bool,
}

/// A current alarm.
#[derive(Debug, Clone, Copy)]
struct Alarm {
    state: &'static str,
    contact_ns: i64,
    newest_ns: i64,
    joints: u32,
}

/// The sensor.
pub(crate) struct Sensor {
    name: &'static str,
    /// Joint names in the learnt state; empty if the sensor does not learn.
    joint_names: Vec<String>,
    blocks: Tap<Blocks>,
    joints: Vec<Joint>,
    validity: Vec<Validity>,
    learning: Option<Learning>,
    state: LearningState,
    asked: bool,
    settling_s: f64,
    hold_ns: i64,
    /// Newest stamp, and time since the last reset.
    newest_ns: Option<i64>,
    elapsed_s: f64,
    newest_low_ns: Option<i64>,
    alarm: Option<Alarm>,
    newest_alarm_ns: Option<i64>,
}

/// Results of all joints for a sample.
#[derive(Default)]
struct Readings {
    /// Largest ratio of residue to threshold: over all joints (`ratio`) and over the tested ones (`score`).
    ratio: f64,
    score: f64,
    /// Joints with a collision, and joints with a wrong model: bit j for joint j.
    colliding: u32,
    wrong: u32,
    /// Whether the model of any joint may be wrong.
    doubtful: bool,
}

impl Sensor {
    /// Creates a sensor with the initial bias `first` of each joint; it does not learn. Sensors may share the
    /// evaluation of the currents through `shared`.
    pub(crate) fn new(
        name: &'static str,
        tuning: Tuning,
        first: &[f64],
        hold_s: f64,
        shared: Option<&Shared>,
    ) -> Self {
        let joints = first.iter();
        let blocks = Blocks::new(tuning.block, first.len());
        Self {
            name,
            joint_names: Vec::new(),
            blocks: match shared {
                Some(shared) => shared.tap(tuning.block, || blocks),
                None => Tap::own(blocks),
            },
            joints: (joints
                .clone()
                .map(|&first| Joint::new(tuning, Bias::new(first))))
            .collect(),
            validity: joints.map(|&first| Validity::new(first)).collect(),
            learning: None,
            state: LearningState::default(),
            asked: false,
            settling_s: Butterworth2::new(tuning.block.cutoff_hz).settling_time_s()
                + tuning.block.period_s,
            hold_ns: (hold_s * 1e9) as i64,
            newest_ns: None,
            elapsed_s: 0.0,
            newest_low_ns: None,
            alarm: None,
            newest_alarm_ns: None,
        }
    }

    /// Enables learning, starting from the state `learnt` in an earlier run.
    pub(crate) fn let_learn(
        &mut self,
        learning: Learning,
        joint_names: &[String],
        learnt: Option<&Learnt>,
    ) {
        self.joint_names = joint_names.to_vec();
        self.learning = Some(learning);
        self.asked = learning.at_start && learnt.is_none();
        for (joint, name) in self.joints.iter_mut().zip(joint_names) {
            if let Some(learnt) = learnt.and_then(|learnt| learnt.joints.get(name)) {
                joint.bias = Bias::resume(learnt);
            }
        }
    }

    /// Clears the state of the signals; the learnt state is kept.
    fn reset(&mut self) {
        for validity in &mut self.validity {
            validity.reset();
        }
        self.elapsed_s = 0.0;
        self.newest_low_ns = None;
        self.alarm = None;
        self.newest_alarm_ns = None;
    }

    /// Evaluates every joint. `usual` is `None` while the sensor is not ready; otherwise the joints' models are
    /// checked. If `usual` is true, the biases are estimated, too.
    fn read(
        &mut self,
        dt_s: f64,
        currents: &[Currents; MAX_JOINTS],
        usual: Option<bool>,
    ) -> Readings {
        let mut all = Readings::default();
        for (j, joint) in self.joints.iter_mut().enumerate() {
            let reading: Reading = joint.read(dt_s, &currents[j]);
            let of_joint = reading.ratio();
            all.ratio = all.ratio.max(of_joint);
            if reading.phase.is_tested() {
                all.score = all.score.max(of_joint);
            }
            let Some(usual) = usual else {
                continue;
            };
            let validity = &mut self.validity[j];
            validity.update(dt_s, reading.residue);
            all.doubtful |= validity.is_doubtful();
            all.wrong |= u32::from(validity.is_wrong()) << j;
            all.colliding |= u32::from(reading.collides()) << j;
            if usual {
                joint.estimate_bias(&reading);
            }
        }
        all
    }

    /// Advances the learning machine.
    fn learn(&mut self, dt_s: f64) {
        let Some(learning) = self.learning else {
            return;
        };
        let asked = std::mem::take(&mut self.asked);
        let service = self.state.step(dt_s, learning.duration_s, asked);
        for joint in &mut self.joints {
            match service {
                Service::None => {}
                Service::Init => joint.init_bias(),
                Service::Set => joint.bias.set(),
                Service::Adapt => joint.bias.adapt(),
            }
        }
    }

    /// Updates the alarm with the sample at `stamp_ns`: the joints `colliding` detect a collision, the model is wrong
    /// for the joints `wrong`, and `doubtful` for any joint.
    fn alarm(
        &mut self,
        stamp_ns: i64,
        colliding: u32,
        wrong: u32,
        doubtful: bool,
    ) -> Option<Alarm> {
        let (state, joints) = match self.alarm {
            // A collision keeps its kind until it ends.
            Some(alarm) if alarm.state == COLLISION && colliding != 0 => (COLLISION, colliding),
            _ if wrong != 0 => (MODEL_ERROR, wrong | colliding),
            _ if doubtful && colliding != 0 => (MODEL_ERROR, colliding),
            _ if colliding != 0 => (COLLISION, colliding),
            Some(alarm) if stamp_ns - alarm.newest_ns < self.hold_ns => return self.alarm,
            _ => {
                self.alarm = None;
                return None;
            }
        };
        let open = self.alarm.filter(|alarm| alarm.state == state);
        self.alarm = Some(Alarm {
            state,
            contact_ns: open.map_or(self.newest_low_ns.unwrap_or(stamp_ns), |a| a.contact_ns),
            newest_ns: stamp_ns,
            joints: joints | open.map_or(0, |alarm| alarm.joints),
        });
        self.alarm
    }
}

impl Detector for Sensor {
    fn name(&self) -> &'static str {
        self.name
    }

    fn threshold(&self) -> Option<f64> {
        Some(1.0)
    }

    fn is_learning(&self) -> bool {
        let learns = self.asked || self.state != LearningState::Idle;
        self.learning.is_some() && learns
    }

    fn learnt(&self) -> Option<State> {
        self.learning?;
        let joints = self.joints.iter().map(|joint| joint.bias.learnt());
        let joints = self.joint_names.iter().cloned().zip(joints);
        let joints = joints.collect();
        serde_json::to_value(Learnt { joints }).ok()
    }

    fn judge(&mut self, sample: &TwinState) -> Judgement {
        let stamp_ns = sample.header.stamp_ns;
        let step = self.blocks.with(|blocks| *blocks.update(sample));
        // The shared blocks may already have processed this sample for another sensor: a repeated stamp is no time
        // step.
        let is_new = self.newest_ns.replace(stamp_ns) != Some(stamp_ns);
        let dt_s = if is_new { step.dt_s } else { 0.0 };
        if step.anew && is_new {
            self.reset();
        }
        if sample.header.has(flags::LEARN) {
            // The paper's AdaptReq.
            self.asked = true;
        }
        self.elapsed_s += dt_s;
        // Remark 2: filters and averages are invalid at first.
        let ready = self.elapsed_s >= self.settling_s && sample.header.has(flags::READY);
        if ready {
            self.learn(dt_s);
        }

        // Nothing is learnt during an alarm and shortly after it.
        let usual = self
            .newest_alarm_ns
            .is_none_or(|newest| stamp_ns - newest > AFTER_ALARM_NS);
        let all = self.read(dt_s, &step.currents, ready.then_some(usual));
        let score = all.score;
        if !ready {
            self.alarm = None;
            self.newest_low_ns = None;
            return Judgement {
                score,
                ready,
                verdict: None,
            };
        }
        let alarm = self.alarm(stamp_ns, all.colliding, all.wrong, all.doubtful);
        if all.ratio < LOW_RATIO || self.newest_low_ns.is_none() {
            self.newest_low_ns = Some(stamp_ns);
            for joint in &mut self.joints {
                joint.trust_bias();
            }
        }
        if alarm.is_some() {
            self.newest_alarm_ns = Some(stamp_ns);
            // Nor from the rise before the alarm: otherwise every collision would make the next one harder to detect.
            if self.state == LearningState::Idle {
                for joint in &mut self.joints {
                    joint.distrust_bias();
                }
            }
        }
        let quiet = match self.state {
            LearningState::Init | LearningState::Learning(_) => LEARNING,
            LearningState::Idle | LearningState::Adapt => FREE,
        };
        Judgement {
            score,
            ready,
            verdict: Some(Verdict {
                state: alarm.map_or(quiet, |alarm| alarm.state),
                contact: alarm.map(|alarm| Seen {
                    contact_ns: alarm.contact_ns,
                    joints: Some(alarm.joints),
                    place: None,
                }),
            }),
        }
    }
}
