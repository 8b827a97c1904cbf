//! Sensors of the arm: from its true state to the published values.

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tauscope_bus::{JointArray, MAX_JOINTS};

use super::error::ScenarioError;
use super::scenario::{EffortUnit, Scenario, Sensors};
use super::trajectory::JointRange;

/// The sensors of an arm.
#[derive(Debug)]
pub(super) struct SensorBank {
    joint_count: usize,
    position_noise_rad: f64,
    position_step_rad: f64,
    velocity_noise_rad_s: f64,
    velocity_step_rad_s: f64,
    effort_step_nm: f64,
    effort_noise_nm: JointArray,
    effort_gain: JointArray,
    effort_bias_nm: JointArray,
    unit_per_nm: JointArray,
    rng: ChaCha8Rng,
}

impl SensorBank {
    pub fn new(
        scenario: &Scenario,
        joints: &[JointRange],
        rng: ChaCha8Rng,
    ) -> Result<Self, ScenarioError> {
        let sensors = &scenario.sensors;
        let mut unit_per_nm = [1.0; MAX_JOINTS];
        if scenario.effort_unit == EffortUnit::A {
            for (unit, joint) in unit_per_nm.iter_mut().zip(joints) {
                let constant = scenario.torque_constants_nm_per_a.get(&joint.name);
                match constant {
                    Some(&constant) if constant > 0.0 => *unit = 1.0 / constant,
                    _ => {
                        let joint = joint.name.clone();
                        return Err(ScenarioError::NoTorqueConstant { joint });
                    }
                }
            }
        }
        let mut noise_nm = [0.0; MAX_JOINTS];
        for (noise, joint) in noise_nm.iter_mut().zip(joints) {
            *noise = effort_noise_nm(sensors, joint);
        }
        Ok(Self {
            joint_count: joints.len(),
            position_noise_rad: sensors.position_noise_rad,
            position_step_rad: sensors.position_step_rad,
            velocity_noise_rad_s: sensors.velocity_noise_rad_s,
            velocity_step_rad_s: sensors.velocity_step_rad_s,
            effort_step_nm: sensors.effort_step_nm,
            effort_noise_nm: noise_nm,
            effort_gain: by_joint("sensors.effort_gain", &sensors.effort_gain, 1.0, joints)?,
            effort_bias_nm: by_joint(
                "sensors.effort_bias_nm",
                &sensors.effort_bias_nm,
                0.0,
                joints,
            )?,
            unit_per_nm,
            rng,
        })
    }

    /// A position in whole steps of the encoder.
    pub fn in_steps(&self, position: &JointArray) -> JointArray {
        position.map(|value| whole_steps(value, self.position_step_rad))
    }

    /// Measures position \[rad\] and velocity \[rad/s\].
    pub fn measure_motion(
        &mut self,
        position: &[f64],
        velocity: &[f64],
    ) -> (JointArray, JointArray) {
        let mut measured = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for j in 0..self.joint_count {
            let exact = position[j] + self.position_noise_rad * self.noise();
            measured.0[j] = whole_steps(exact, self.position_step_rad);
            let exact = velocity[j] + self.velocity_noise_rad_s * self.noise();
            measured.1[j] = whole_steps(exact, self.velocity_step_rad_s);
        }
        measured
    }

    /// Measures what is driven with `effort_nm`, in the scenario's unit.
    pub fn measure_effort(&mut self, effort_nm: &[f64]) -> JointArray {
        let mut measured = [0.0; MAX_JOINTS];
        for j in 0..self.joint_count {
            let effort_nm = self.effort_gain[j] * effort_nm[j]
                + self.effort_bias_nm[j]
                + self.effort_noise_nm[j] * self.noise();
            measured[j] = whole_steps(effort_nm, self.effort_step_nm) * self.unit_per_nm[j];
        }
        measured
    }

    /// Drawn whether it is used or not: changing one noise leaves the others as they were.
    fn noise(&mut self) -> f64 {
        StandardNormal.sample(&mut self.rng)
    }
}

/// Standard deviation of the noise on a joint's effort \[N m\].
pub(super) fn effort_noise_nm(sensors: &Sensors, joint: &JointRange) -> f64 {
    let share_nm = if joint.effort.is_finite() {
        sensors.effort_noise_of_limit * joint.effort
    } else {
        0.0
    };
    sensors.effort_noise_nm.hypot(share_nm)
}

/// `value` rounded to a multiple of `step`, if that is not 0.
fn whole_steps(value: f64, step: f64) -> f64 {
    if step > 0.0 {
        (value / step).round() * step
    } else {
        value
    }
}

/// Values by joint name, put into the robot's order.
fn by_joint(
    what: &'static str,
    values: &std::collections::BTreeMap<String, f64>,
    default: f64,
    joints: &[JointRange],
) -> Result<JointArray, ScenarioError> {
    let mut array = [default; MAX_JOINTS];
    for (name, &value) in values {
        let Some(j) = joints.iter().position(|joint| joint.name == *name) else {
            return Err(ScenarioError::UnknownJoint {
                what,
                joint: name.clone(),
                known: joints
                    .iter()
                    .map(|joint| joint.name.as_str())
                    .collect::<Vec<_>>()
                    .join(", "),
            });
        };
        array[j] = value;
    }
    Ok(array)
}
