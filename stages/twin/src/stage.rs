//! The twin as a stage: joint states in, expected effort and residual out.

use tauscope_bus::{
    Emit, Header, JointArray, JointState, MAX_JOINTS, Stage, StageError, TwinState, flags,
};
use tauscope_dynamics::terms::{MotionSample, Physics, TermError};
use tauscope_dynamics::{Data, Inertia, Model, lowpass::Butterworth2, rnea};

use crate::config::{Config, Expected};
use crate::motion::MotionTracker;
use crate::plain_zeros::PlainZeros;
use crate::twin_file::Correction;

/// Minimum pause between two recordings, after which the motors may have cooled; a shorter one is a gap \[ns\].
/// Physical: drives cool in minutes, whereas drivers and networks reconnect within seconds.
const PAUSE_NS: i64 = 60_000_000_000;

/// Facts about the cell that the twin needs.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The robot; may be absent where the expected effort comes from a topic.
    pub model: Option<Model>,
    /// The joints, in URDF order.
    pub joint_names: Vec<String>,
    /// Torque constants by joint \[N m/A\], where the effort is a current and they are known.
    pub torque_constants_nm_per_a: Option<Vec<f64>>,
    /// Link to which a tool is attached, where the source reports one.
    pub tool_link: Option<usize>,
}

/// Reason why a twin cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum TwinError {
    /// No model from which to compute the effort.
    #[error(
        "the cell has no robot: give `robot: <URDF>`, or `expected: topic` if another twin's effort is recorded"
    )]
    NoModel,
    /// More joints than a sample can hold.
    #[error("{found} joints, at most {MAX_JOINTS} are supported")]
    TooManyJoints {
        /// Number of joints.
        found: usize,
    },
    /// A term of the correction that cannot be built.
    #[error(transparent)]
    Term(#[from] TermError),
    /// A term that changes the effort of the bodies, without a robot model.
    #[error("the twin's `{effect}` needs the robot: give `robot: <URDF>`")]
    UnknownBodies {
        /// The effect.
        effect: &'static str,
    },
}

/// The twin stage. It is deterministic: equal input samples give equal output samples.
#[derive(Debug)]
pub struct Twin {
    expected: Expected,
    max_gap_s: f64,
    settling_time_s: f64,
    model: Option<(Model, Data)>,
    tool_link: Option<usize>,
    tool: Option<[f64; 10]>,
    correction: Correction,
    physics: Physics,
    /// N m per model unit: 1, or the torque constant.
    nm_per_unit: Vec<f64>,
    motion: MotionTracker,
    plain_zeros: PlainZeros,
    measured_filters: Vec<Butterworth2>,
    expected_filters: Vec<Butterworth2>,
    /// Stamp of the previous sample, and of the last reset.
    previous_ns: Option<i64>,
    reset_ns: i64,
    /// Newest stamp, and first stamp of the recording.
    last_ns: Option<i64>,
    recording_ns: i64,
    /// First stamp of the session.
    start_ns: Option<i64>,
}

impl Twin {
    /// Creates a twin for a cell; `correction` is in the cell's joint order.
    ///
    /// # Errors
    /// If a required model is missing, there are too many joints, or a term of the correction does not fit the robot.
    pub fn new(config: &Config, setup: Setup, correction: Correction) -> Result<Self, TwinError> {
        let joint_count = setup.joint_names.len();
        if joint_count > MAX_JOINTS {
            return Err(TwinError::TooManyJoints { found: joint_count });
        }
        if config.expected == Expected::Model && setup.model.is_none() {
            return Err(TwinError::NoModel);
        }
        let filters = config.filters(None);
        let motion = MotionTracker::new(config.motion, joint_count, filters.velocity_cutoff_hz);
        let effort_filters: Vec<Butterworth2> = (correction.joints.iter())
            .map(|joint| joint.effort_cutoff_hz.unwrap_or(filters.effort_cutoff_hz))
            .map(Butterworth2::new)
            .collect();
        let settles_s = effort_filters.iter().map(Butterworth2::settling_time_s);
        let efforts_settle_s = settles_s.fold(0.0, f64::max);
        let nm_per_unit = setup
            .torque_constants_nm_per_a
            .unwrap_or_else(|| vec![1.0; joint_count]);
        let physics = physics(&correction, setup.model.as_ref(), &setup.joint_names)?;
        Ok(Self {
            expected: config.expected,
            max_gap_s: config.max_gap_s,
            settling_time_s: motion.settling_time_s() + efforts_settle_s,
            model: setup.model.map(|model| {
                let data = Data::new(&model);
                (model, data)
            }),
            tool_link: setup.tool_link,
            tool: None,
            correction,
            physics,
            nm_per_unit,
            motion,
            plain_zeros: PlainZeros::default(),
            measured_filters: effort_filters.clone(),
            expected_filters: effort_filters,
            previous_ns: None,
            reset_ns: 0,
            last_ns: None,
            recording_ns: 0,
            start_ns: None,
        })
    }

    /// Returns the settling time of the filters after the start or a gap \[s\].
    pub fn settling_time_s(&self) -> f64 {
        self.settling_time_s
    }

    /// Attaches the tool that the sample reports, if it differs from the current one.
    fn follow_tool(&mut self, sample: &JointState) -> Result<(), StageError> {
        let (Some((model, _)), Some(link)) = (&mut self.model, self.tool_link) else {
            return Ok(());
        };
        let tool = sample.header.has(flags::TOOL).then(|| {
            let mut all = [sample.tool_mass_kg; 10];
            all[1..4].copy_from_slice(&sample.tool_com_m);
            all[4..].copy_from_slice(&sample.tool_inertia_kgm2);
            all
        });
        if tool == self.tool {
            return Ok(());
        }
        self.tool = tool;
        let inertia = tool.map_or_else(Inertia::zero, |_| {
            Inertia::new(
                sample.tool_mass_kg,
                sample.tool_com_m,
                sample.tool_inertia_kgm2,
            )
        });
        model.set_tool(link, inertia);
        if !self.physics.bodies().is_empty() {
            // A tilted base or an elastic joint carries the tool as well.
            self.physics =
                Physics::build(&self.correction.terms, model).map_err(StageError::failed)?;
        }
        Ok(())
    }

    /// Updates the start of the recording. A short gap does not start a new one, because the motors stay warm.
    fn follow_recording(&mut self, stamp_ns: i64) {
        let since_last = self.last_ns.map(|last| stamp_ns - last);
        if !since_last.is_some_and(|ns| (0..PAUSE_NS).contains(&ns)) {
            self.recording_ns = stamp_ns;
        }
        self.last_ns = Some(stamp_ns);
    }

    /// Returns the expected effort of the current motion in the measured effort's unit, unfiltered.
    ///
    /// `expected = record(gain * bodies(rigid) + joints) / torque constant + offset`, where bodies, joints
    /// and record are the terms of these layers and rigid is the effort of the rigid-body model or of an
    /// external twin.
    fn expected_effort(&mut self, dt_s: f64, sample: &JointState) -> JointArray {
        let n = self.nm_per_unit.len();
        let stamp_ns = sample.header.stamp_ns;
        let since_s = |ns: i64| (stamp_ns - ns) as f64 * 1e-9;
        let mut effort = [0.0; MAX_JOINTS];
        let (position, velocity, acceleration) = (
            &self.motion.position[..n],
            &self.motion.velocity[..n],
            &self.motion.acceleration[..n],
        );
        if let (Some((model, data)), Expected::Model) = (&mut self.model, self.expected) {
            effort[..n].copy_from_slice(rnea(model, data, position, velocity, acceleration));
        } else {
            let reference = sample.reference_effort.iter().zip(&self.nm_per_unit);
            for (value, (reference, nm)) in effort.iter_mut().zip(reference) {
                *value = reference * nm;
            }
        }
        let at = MotionSample {
            dt_s,
            recording_s: since_s(self.recording_ns),
            session_s: since_s(self.start_ns.unwrap_or(stamp_ns)),
            position,
            velocity,
            acceleration,
            transmitted: &[],
        };
        self.physics.act_bodies(&at, &mut effort[..n]);
        for (value, joint) in effort[..n].iter_mut().zip(&self.correction.joints) {
            *value *= joint.gain;
        }
        self.physics.act_joints(&at, &mut effort[..n]);
        for (j, joint) in self.correction.joints.iter().enumerate() {
            effort[j] = effort[j] / self.nm_per_unit[j] + joint.offset;
        }
        effort
    }
}

/// Builds the terms of a correction for the robot or, without a model, for its joints alone.
fn physics(
    correction: &Correction,
    model: Option<&Model>,
    joint_names: &[String],
) -> Result<Physics, TwinError> {
    let Some(model) = model else {
        let stand_in = Model::massless(joint_names);
        let physics = Physics::build(&correction.terms, &stand_in)?;
        return match physics.bodies().first() {
            Some(term) => Err(TwinError::UnknownBodies {
                effect: term.effect().name,
            }),
            None => Ok(physics),
        };
    };
    Ok(Physics::build(&correction.terms, model)?)
}

impl Stage<JointState, TwinState> for Twin {
    fn accept(
        &mut self,
        sample: &JointState,
        out: &mut dyn Emit<TwinState>,
    ) -> Result<(), StageError> {
        let n = self.nm_per_unit.len();
        let stamp_ns = sample.header.stamp_ns;
        let dt_s = self
            .previous_ns
            .map(|before| (stamp_ns - before) as f64 * 1e-9);
        // A time that runs backwards, a gap, or a reset by the source invalidates the filter states.
        let go_on = matches!(dt_s, Some(dt) if (0.0..=self.max_gap_s).contains(&dt))
            && !sample.header.has(flags::RESET);

        self.follow_tool(sample)?;
        self.start_ns.get_or_insert(stamp_ns);
        self.follow_recording(stamp_ns);
        let dt_s = if go_on { dt_s.unwrap_or(0.0) } else { 0.0 };
        if go_on {
            self.motion.update(dt_s, sample);
        } else {
            self.motion.reset(sample);
            self.physics.reset();
            self.reset_ns = stamp_ns;
        }
        let expected = self.expected_effort(dt_s, sample);
        let has_expected = self.expected == Expected::Model || sample.header.has(flags::REFERENCE);
        let is_measured = sample.header.has(flags::EFFORT_MEASURED)
            && !(has_expected && self.plain_zeros.are(&sample.effort[..n], &expected[..n]));
        let known = self.motion.knows(sample) && is_measured && has_expected;
        let (mut filtered, mut filtered_expected) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for j in 0..n {
            let (measured, model) = (&mut self.measured_filters[j], &mut self.expected_filters[j]);
            if !go_on {
                measured.reset(sample.effort[j]);
                model.reset(expected[j]);
            }
            filtered[j] = measured.update(dt_s, sample.effort[j]);
            filtered_expected[j] = model.update(dt_s, expected[j]);
        }
        if known {
            self.previous_ns = Some(stamp_ns);
        } else {
            // The filter states are invalid now: reset them at the next sample.
            self.previous_ns = None;
        }
        let settled = (stamp_ns - self.reset_ns) as f64 * 1e-9 >= self.settling_time_s;
        let mut header = Header {
            sequence: 0,
            ..sample.header
        };
        header.flags &= !(flags::READY | flags::RESET);
        if !is_measured {
            header.flags &= !flags::EFFORT_MEASURED;
        }
        if known && go_on && settled {
            header.flags |= flags::READY;
        }
        if !go_on {
            header.flags |= flags::RESET;
        }
        out.emit(&mut |slot| {
            slot.header = header;
            slot.position = self.motion.position;
            slot.velocity = self.motion.velocity;
            slot.acceleration = self.motion.acceleration;
            slot.effort = sample.effort;
            slot.expected_effort = expected;
            slot.filtered_effort = filtered;
            slot.filtered_expected_effort = filtered_expected;
            for j in 0..n {
                slot.residual[j] = filtered[j] - filtered_expected[j];
            }
        })?;
        Ok(())
    }
}
