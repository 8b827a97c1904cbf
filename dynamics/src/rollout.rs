//! Simulation of an arm in closed loop: a rigid arm with dry friction under a PID controller with feedforward.
//!
//! Semi-implicit time stepping. The controller, viscous friction and springs are implicit, so stiff gains need no short
//! step. Dry friction is an impulse of each joint within its bounds, opposed to the velocity at the end of the step
//! (Stewart and Trinkle, "An implicit time-stepping scheme for rigid body dynamics with inelastic collisions and Coulomb
//! friction", *Int. J. Numerical Methods in Engineering* 39, 1996), solved by projected Gauss-Seidel iterations.

use nalgebra::{DMatrix, DVector};

use crate::crba::mass_matrix;
use crate::data::Data;
use crate::model::{Drive, Model};
use crate::rnea::{gravity_effort, rnea};
use crate::servo::{Commands, Feedforward, Servo};

/// Longest step \[s\]. Resolution: that of physics engines by default is 1 to 2 ms.
const STEP_S: f64 = 1e-3;
/// Gauss-Seidel iterations a step. Resolution: friction of joints that move each other.
const SWEEPS: usize = 20;
/// Speed beyond which a simulation has failed \[rad/s or m/s\]. Physical: no arm is so fast.
const FASTEST: f64 = 1e3;

/// An arm and its controller.
#[derive(Debug)]
pub struct ClosedLoop<'a> {
    arm: &'a Model,
    drives: &'a [Drive],
    /// The controller's own model, for gravity.
    known: &'a Model,
    servos: &'a [Servo],
    data: Data,
    known_data: Data,
    zeros: Vec<f64>,
}

/// State of the arm and of its controller.
struct State {
    q: Vec<f64>,
    v: DVector<f64>,
    /// Integral of the position's error.
    integral: Vec<f64>,
}

impl<'a> ClosedLoop<'a> {
    /// An arm with the drives of its joints, and the controller with the model that it compensates gravity by.
    ///
    /// # Panics
    /// If the lengths of `drives` and `servos`, or the joints of both models, differ.
    pub fn new(
        (arm, drives): (&'a Model, &'a [Drive]),
        (known, servos): (&'a Model, &'a [Servo]),
    ) -> Self {
        let n = arm.dof();
        assert!(
            drives.len() == n && servos.len() == n && known.dof() == n,
            "a drive and a servo for each joint"
        );
        Self {
            arm,
            drives,
            known,
            servos,
            data: Data::new(arm),
            known_data: Data::new(known),
            zeros: vec![0.0; n],
        }
    }

    /// Positions at the times of the commands, row by row, from the position `q` and the velocity `v` at the first of them.
    /// Nothing if the motion leaves all bounds.
    pub fn positions(&mut self, q: &[f64], v: &[f64], commands: &Commands<'_>) -> Option<Vec<f64>> {
        let n = self.zeros.len();
        let mut state = State {
            q: q.to_vec(),
            v: DVector::from_column_slice(v),
            integral: vec![0.0; n],
        };
        let mut all = state.q.clone();
        for pair in commands.time_s.windows(2) {
            let span_s = pair[1] - pair[0];
            let steps = (span_s / STEP_S).ceil().max(1.0);
            let step_s = span_s / steps;
            for step in 0..steps as usize {
                let at_s = pair[0] + step as f64 * step_s;
                self.step(&mut state, commands, at_s, step_s)?;
            }
            all.extend_from_slice(&state.q);
        }
        Some(all)
    }

    /// One step of `h` seconds.
    fn step(
        &mut self,
        state: &mut State,
        commands: &Commands<'_>,
        at_s: f64,
        h: f64,
    ) -> Option<()> {
        let State { q, v, integral } = state;
        let n = q.len();
        let (mut from, mut explicit) = (vec![0.0; n], DVector::zeros(n));
        commands.at(at_s, n, |j, position, _| from[j] = position);
        let gravity = gravity_effort(self.known, &mut self.known_data, q);
        let bias = rnea(self.arm, &mut self.data, q, v.as_slice(), &self.zeros);
        commands.at(at_s + h, n, |j, to, motion| {
            let (servo, drive) = (&self.servos[j], &self.drives[j]);
            let feedforward = match servo.feedforward {
                Feedforward::Gravity => gravity[j],
                Feedforward::Motion => motion,
            };
            explicit[j] = servo.position * (to - q[j])
                + servo.integral * integral[j]
                + servo.velocity * servo.commanded_velocity * (to - from[j]) / h
                + servo.share * feedforward
                + servo.offset
                - bias[j]
                - drive.stiffness * (q[j] - drive.rest);
            integral[j] += h * (to - q[j]);
        });
        let mut matrix: DMatrix<f64> = mass_matrix(self.arm, &mut self.data, q).clone();
        for (j, drive) in self.drives.iter().enumerate() {
            matrix[(j, j)] += drive.rotor_inertia;
        }
        let right = &matrix * &*v + explicit * h;
        for (j, (servo, drive)) in self.servos.iter().zip(self.drives).enumerate() {
            let damping = servo.velocity + drive.damping;
            let stiffness = servo.position + drive.stiffness;
            matrix[(j, j)] += h * damping + h * h * stiffness;
        }
        let inverse = matrix.cholesky()?.inverse();
        *v = &inverse * right;
        let mut impulse = vec![0.0; n];
        for _ in 0..SWEEPS {
            for j in 0..n {
                let most = self.drives[j].friction * h;
                let stopping = impulse[j] - v[j] / inverse[(j, j)];
                let next = stopping.clamp(-most, most);
                v.axpy(next - impulse[j], &inverse.column(j), 1.0);
                impulse[j] = next;
            }
        }
        q.iter_mut().zip(v.iter()).for_each(|(q, v)| *q += h * v);
        v.iter().all(|v| v.abs() < FASTEST).then_some(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
pub(crate) mod tests {
    use super::*;

    /// A rod of 2 kg, 0.5 m from its hinge.
    pub(crate) fn pendulum() -> Model {
        let urdf = r#"<robot name="pendulum"><link name="base"/>
            <link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
            <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
            <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/>
            <axis xyz="1 0 0"/></joint></robot>"#;
        Model::from_urdf(urdf).unwrap()
    }

    fn last(drive: Drive, servo: Servo, start: [f64; 2], command: f64, time_s: f64) -> f64 {
        let (model, drives, servos) = (pendulum(), [drive], [servo]);
        let (times_s, rows) = ([0.0, time_s], [command; 2]);
        let commands = Commands::new(&model, &times_s, &rows);
        let mut arm = ClosedLoop::new((&model, &drives), (&model, &servos));
        let all = arm.positions(&start[..1], &start[1..], &commands);
        *all.unwrap().last().unwrap()
    }

    #[test]
    fn a_free_pendulum_swings_with_its_period() {
        // 2 pi sqrt(l / g), for a small angle.
        let period_s = std::f64::consts::TAU * (0.5_f64 / 9.81).sqrt();
        let angle = last(
            Drive::default(),
            Servo::default(),
            [0.01, 0.0],
            0.0,
            period_s,
        );
        assert!((angle - 0.01).abs() < 1e-4, "{angle}");
    }

    #[test]
    fn dry_friction_holds_what_it_can_hold() {
        // Level, the rod weighs 9.81 N m.
        let at = |friction: f64| {
            let drive = Drive {
                friction,
                ..Drive::default()
            };
            last(drive, Servo::default(), [1.5, 0.0], 0.0, 0.2)
        };
        assert!((at(10.0) - 1.5).abs() < 1e-12);
        assert!(at(9.0) < 1.499);
    }

    #[test]
    fn a_stiff_controller_is_stable_and_dry_friction_leaves_its_error() {
        let servo = Servo {
            position: 1e4,
            velocity: 300.0,
            share: 1.0,
            ..Servo::default()
        };
        let drive = Drive {
            friction: 2.0,
            rotor_inertia: 0.1,
            ..Drive::default()
        };
        let error = 0.5 - last(drive, servo, [0.0, 0.0], 0.5, 5.0);
        assert!(error.abs() <= 2.001e-4, "{error}");
    }
}
