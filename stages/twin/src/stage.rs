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

/// A pause this long begins another recording, with motors that may have cooled; a shorter one is a gap \[ns\].
/// Physical: drives cool in minutes, and drivers and networks come back in seconds.
const PAUSE_NS: i64 = 60_000_000_000;

/// What the twin must know of its cell.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The robot; may be absent where the expected effort comes from a topic.
    pub model: Option<Model>,
    /// The joints, in URDF order.
    pub joint_names: Vec<String>,
    /// Torque constants by joint \[N m/A\], where the effort is a current and they are known.
    pub torque_constants_nm_per_a: Option<Vec<f64>>,
    /// The link a tool is attached to, where the source tells of one.
    pub tool_link: Option<usize>,
}

/// Why a twin cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum TwinError {
    /// There is no model to compute the effort from.
    #[error(
        "the cell has no robot: give `robot: <URDF>`, or `expected: topic` if another twin's effort is recorded"
    )]
    NoModel,
    /// The sample type has no room for so many joints.
    #[error("{found} joints, at most {MAX_JOINTS} are supported")]
    TooManyJoints {
        /// How many there are.
        found: usize,
    },
    /// One of the terms of the correction cannot be built.
    #[error(transparent)]
    Term(#[from] TermError),
    /// A term that changes what bodies cost, in a robot that is not known.
    #[error("the twin's `{effect}` needs the robot: give `robot: <URDF>`")]
    UnknownBodies {
        /// The effect.
        effect: &'static str,
    },
}

/// The twin stage. Pure: the same samples in give the same samples out.
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
    /// Stamp of the sample before, and of the last reset.
    previous_ns: Option<i64>,
    reset_ns: i64,
    /// The newest stamp, and where the recording begins.
    last_ns: Option<i64>,
    recording_ns: i64,
    /// The first stamp of all: where the session begins.
    start_ns: Option<i64>,
}

impl Twin {
    /// A twin for a cell; `correction` in the cell's joint order.
    ///
    /// # Errors
    /// If it needs a model and there is none, there are too many joints, or a term of the correction does
    /// not fit the robot.
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

    /// How long the filters take to settle after the start or a gap \[s\].
    pub fn settling_time_s(&self) -> f64 {
        self.settling_time_s
    }

    /// Attaches the tool that the sample tells of, if it is another than before.
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
            // A tilted base or an elastic joint bears the tool as well.
            self.physics =
                Physics::build(&self.correction.terms, model).map_err(StageError::failed)?;
        }
        Ok(())
    }

    /// Where the recording begins: a short gap makes no motor cold.
    fn follow_recording(&mut self, stamp_ns: i64) {
        let since_last = self.last_ns.map(|last| stamp_ns - last);
        if !since_last.is_some_and(|ns| (0..PAUSE_NS).contains(&ns)) {
            self.recording_ns = stamp_ns;
        }
        self.last_ns = Some(stamp_ns);
    }

    /// Expected effort of the motion as it stands, in the measured effort's unit; not filtered.
    ///
    /// `expected = record(gain * bodies(rigid) + joints) / torque constant + offset`, where bodies, joints
    /// and record are the terms of these layers and rigid is the effort of the rigid body, or that of
    /// somebody else's twin.
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

/// The terms of a correction, built for the robot or, where it is not known, for its joints alone.
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
        // A time that runs backwards, a gap, or a source that says so: what the filters hold is void.
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
            // The filters hold a void value now: begin anew at the next sample that is whole.
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
