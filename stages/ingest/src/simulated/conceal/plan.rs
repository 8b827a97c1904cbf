//! Planned motions, and the effect of physics on their efforts.

use tauscope_dynamics::terms::{MotionSample, Physics, TermSpec};
use tauscope_dynamics::{Data, Model, rnea};

use super::super::error::ScenarioError;
use super::super::plan::{joint_ranges, offset_ns, random, trajectory, with_tool};
use super::super::scenario::Scenario;
use super::super::sensors::effort_noise_nm;
use super::super::trajectory::{JointRange, Target};

/// Sampling rate of the planned motions \[Hz\].
/// Resolution: of the effort by which an effect is sized.
const RATE_HZ: f64 = 100.0;
/// Noise assumed for noiseless sensors, as a fraction of the motor's effort.
/// Chosen: for simulated cells only; of the order of the noise of real effort sensors.
const NO_NOISE: f64 = 0.002;
/// Largest fraction of a motor's effort that the motions may need with the effect.
/// Chosen: for simulated cells only; a tenth stays for the corrections of the controller.
const MOTOR_SHARE: f64 = 0.9;
/// Effort change below which an instant is treated as unchanged \[N m\].
/// Resolution: above the rounding of efforts.
const NOTHING: f64 = 1e-9;

/// An instant of a planned motion.
#[derive(Debug)]
pub(super) struct Instant {
    pub recording_s: f64,
    pub session_s: f64,
    pub target: Target,
    rigid: Vec<f64>,
}

/// The planned motions of a scenario.
#[derive(Debug)]
pub(super) struct Plan {
    /// The arm with its tool.
    pub model: Model,
    pub joints: Vec<JointRange>,
    pub instants: Vec<Instant>,
    /// Duration of each recording \[s\].
    pub durations_s: Vec<f64>,
    /// Start of each recording in the session \[s\].
    pub starts_s: Vec<f64>,
    /// Highest speed of each joint.
    pub fastest: Vec<f64>,
    /// Highest acceleration of each joint.
    pub largest_acceleration: Vec<f64>,
    /// Largest rigid-body effort of each joint.
    pub largest_nm: Vec<f64>,
    /// Effort limit of each motor.
    pub motor_nm: Vec<f64>,
    noise_nm: Vec<f64>,
    terms: Vec<TermSpec>,
    /// Recorded efforts with those terms, instant by instant.
    efforts: Vec<f64>,
}

impl Plan {
    pub fn new(scenario: &Scenario, model: &Model) -> Result<Self, ScenarioError> {
        let joints = joint_ranges(model)?;
        let n = joints.len();
        let model = with_tool(scenario, model)?;
        let mut data = Data::new(&model);
        let mut plan = Self {
            instants: Vec::new(),
            durations_s: Vec::new(),
            starts_s: Vec::new(),
            fastest: vec![0.0; n],
            largest_acceleration: vec![0.0; n],
            largest_nm: vec![0.0; n],
            motor_nm: Vec::new(),
            noise_nm: Vec::new(),
            terms: scenario.physics.clone(),
            efforts: Vec::new(),
            joints,
            model,
        };
        for (index, spec) in scenario.recordings.iter().enumerate() {
            let rng = random(scenario, index, 0);
            let mut motion = trajectory(spec, &plan.model, &plan.joints, rng)?;
            let start_s = offset_ns(scenario, index) as f64 * 1e-9;
            for k in 0..(spec.duration_s * RATE_HZ) as u64 {
                let recording_s = k as f64 / RATE_HZ;
                let target = motion.at(recording_s);
                let [q, v, a] = [&target.position, &target.velocity, &target.acceleration]
                    .map(|values| &values[..n]);
                let rigid = rnea(&plan.model, &mut data, q, v, a).to_vec();
                for j in 0..n {
                    plan.fastest[j] = plan.fastest[j].max(v[j].abs());
                    plan.largest_acceleration[j] = plan.largest_acceleration[j].max(a[j].abs());
                    plan.largest_nm[j] = plan.largest_nm[j].max(rigid[j].abs());
                }
                plan.instants.push(Instant {
                    recording_s,
                    session_s: start_s + recording_s,
                    target,
                    rigid,
                });
            }
            plan.durations_s.push(spec.duration_s);
            plan.starts_s.push(start_s);
        }
        for (joint, &largest) in plan.joints.iter().zip(&plan.largest_nm) {
            let motor = if joint.effort.is_finite() {
                joint.effort
            } else {
                2.0 * largest.max(1.0)
            };
            let noise = effort_noise_nm(&scenario.sensors, joint);
            plan.motor_nm.push(motor);
            let or = NO_NOISE * motor;
            plan.noise_nm.push(if noise > 0.0 { noise } else { or });
        }
        plan.efforts = plan.recorded(None)?;
        Ok(plan)
    }

    /// Length of the shortest recording \[s\].
    pub fn shortest_s(&self) -> f64 {
        self.durations_s
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min)
    }

    /// Adds a term to the arm.
    pub fn add(&mut self, term: TermSpec) -> Result<(), ScenarioError> {
        self.terms.push(term);
        self.efforts = self.recorded(None)?;
        Ok(())
    }

    /// Returns the effort change by the term in multiples of the noise, at the joint that it changes most.
    pub fn times_noise(&self, term: &TermSpec) -> Result<f64, ScenarioError> {
        let efforts = self.recorded(Some(term))?;
        let n = self.joints.len();
        let most = (0..n).map(|j| {
            let changes = efforts.iter().zip(&self.efforts).skip(j).step_by(n);
            let (mut count, mut squares) = (0.0_f64, 0.0);
            for (with, without) in changes {
                let change = with - without;
                if change.abs() > NOTHING {
                    count += 1.0;
                    squares += change * change;
                }
            }
            (squares / count.max(1.0)).sqrt() / self.noise_nm[j]
        });
        Ok(most.fold(0.0, f64::max))
    }

    /// Returns whether the motors can drive the motions with the term.
    pub fn motors_can(&self, term: &TermSpec) -> Result<bool, ScenarioError> {
        let efforts = self.recorded(Some(term))?;
        let n = self.joints.len();
        let largest = |efforts: &[f64], j: usize| {
            let of_joint = efforts.iter().skip(j).step_by(n);
            of_joint.fold(0.0_f64, |most, effort| most.max(effort.abs()))
        };
        Ok((0..n).all(|j| {
            let allowed = (MOTOR_SHARE * self.motor_nm[j]).max(largest(&self.efforts, j));
            largest(&efforts, j) <= allowed
        }))
    }

    fn recorded(&self, term: Option<&TermSpec>) -> Result<Vec<f64>, ScenarioError> {
        let mut specs = self.terms.clone();
        specs.extend(term.cloned());
        let mut physics = Physics::build(&specs, &self.model)?;
        let n = self.joints.len();
        let mut efforts = Vec::with_capacity(n * self.instants.len());
        let mut effort = vec![0.0; n];
        for instant in &self.instants {
            let first = instant.recording_s == 0.0;
            if first {
                physics.reset();
            }
            effort.copy_from_slice(&instant.rigid);
            let at = MotionSample {
                dt_s: if first { 0.0 } else { 1.0 / RATE_HZ },
                recording_s: instant.recording_s,
                session_s: instant.session_s,
                position: &instant.target.position[..n],
                velocity: &instant.target.velocity[..n],
                acceleration: &instant.target.acceleration[..n],
                transmitted: &instant.rigid,
            };
            physics.act(&at, &mut effort);
            efforts.extend_from_slice(&effort);
        }
        Ok(efforts)
    }
}
