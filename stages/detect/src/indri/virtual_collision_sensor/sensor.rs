//! The whole sensor: the joints' blocks one by one (section 5), the request for learning, and the
//! alarm over all of them.

use tauscope_bus::{MAX_JOINTS, TwinState, flags};
use tauscope_dynamics::lowpass::Butterworth2;

use super::bias::{Bias, LearningState, Service};
use super::blocks::Blocks;
use super::joint::{Currents, Joint, Reading, Tuning};
use super::learnt::Learnt;
use super::validity::Validity;
use crate::frame::{Detector, Judgement, Seen, Shared, State, Tap, Verdict};

/// A ratio from here on may already belong to a collision: where the search for its beginning stops.
/// Tuned: on the practice set of cyclic moves (docs/papers.md); not swept.
const LOW_RATIO: f64 = 0.5;

/// For so long after an alarm nothing is learnt: the model error still remembers it \[ns\].
/// Tuned: on the practice set of cyclic moves (docs/papers.md); not swept.
const AFTER_ALARM_NS: i64 = 2_000_000_000;

/// What the sensor says while nothing is the matter.
const FREE: &str = "free";
/// What it says while it learns and nothing is the matter.
const LEARNING: &str = "learning";
/// A collision.
const COLLISION: &str = "collision";
/// An alarm that is no collision: the expected current does not belong to this robot as it is now.
const MODEL_ERROR: &str = "model_error";

/// How the adaptive version learns; the basic one does not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Learning {
    /// How long learning takes \[s\].
    pub duration_s: f64,
    /// Whether it is asked for as the first sample comes.
    pub at_start: bool,
}

/// An alarm that lasts.
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
    /// Names for what was learnt; empty where nothing is.
    joint_names: Vec<String>,
    blocks: Tap<Blocks>,
    joints: Vec<Joint>,
    validity: Vec<Validity>,
    learning: Option<Learning>,
    state: LearningState,
    asked: bool,
    settling_s: f64,
    hold_ns: i64,
    /// Newest stamp, and how long ago everything began anew.
    newest_ns: Option<i64>,
    elapsed_s: f64,
    newest_low_ns: Option<i64>,
    alarm: Option<Alarm>,
    newest_alarm_ns: Option<i64>,
}

/// What all joints say of a sample.
#[derive(Default)]
struct Readings {
    /// The largest ratio of residue and threshold, of all joints and of those that are tested.
    ratio: f64,
    score: f64,
    /// Joints that see a collision, and whose model is wrong: bit j for joint j.
    colliding: u32,
    wrong: u32,
    /// Whether the model of one may be wrong.
    doubtful: bool,
}

impl Sensor {
    /// A sensor with the first bias of each joint; it learns nothing. What the currents do it may have `shared`.
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

    /// Lets it learn, from what an earlier life has `learnt` of these joints on.
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

    /// Clears what belongs to the signals; what was learnt stays.
    fn reset(&mut self) {
        for validity in &mut self.validity {
            validity.reset();
        }
        self.elapsed_s = 0.0;
        self.newest_low_ns = None;
        self.alarm = None;
        self.newest_alarm_ns = None;
    }

    /// Reads every joint. Where the sensor is ready, its model is judged, and its bias learnt if what it does is `usual`.
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

    /// The step of the learning machine.
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

    /// The alarm after the sample at `stamp_ns`, on which the joints `colliding` detected, the model
    /// does not hold for the joints `wrong`, and is doubtful for any.
    fn alarm(
        &mut self,
        stamp_ns: i64,
        colliding: u32,
        wrong: u32,
        doubtful: bool,
    ) -> Option<Alarm> {
        let (state, joints) = match self.alarm {
            // A collision stays one until it is over.
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
        // What others have asked for at the same stamp is no step of this one's time.
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
        // Remark 2: at first filters and averages say nothing.
        let ready = self.elapsed_s >= self.settling_s && sample.header.has(flags::READY);
        if ready {
            self.learn(dt_s);
        }

        // An alarm is no usual behaviour, nor what the arm does right after it.
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
            // Nor is the way up to it: else every collision would make the next one harder to see.
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
