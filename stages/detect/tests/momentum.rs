//! The momentum observer on simulated arms.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
#![allow(clippy::float_cmp, reason = "tests compare what must be the same bits")]

use tauscope_bus::{Header, TwinState, flags};
use tauscope_detect::frame::momentum::MomentumObserver;
use tauscope_detect::{ConfigError, JointSetup, Setup};
use tauscope_dynamics::{Data, Model, forward_dynamics, rnea};

/// Three joints in a row, axes z, y, y, half a metre apart.
const ARM: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="shoulder"><inertial><origin xyz="0 0 0.25"/><mass value="3"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0 0 0.25"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.1 0 0.25"/><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="a" type="continuous"><parent link="base"/><child link="shoulder"/><axis xyz="0 0 1"/></joint>
  <joint name="b" type="continuous"><origin xyz="0 0 0.5"/><parent link="shoulder"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <joint name="c" type="continuous"><origin xyz="0 0 0.5"/><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/></joint>
</robot>"#;

const EXTERNAL_NM: [f64; 3] = [3.0, -2.0, 1.0];

fn setup(effort_per_nm: f64) -> Setup {
    let joint = JointSetup {
        gain: 1.0,
        offset: 0.0,
        noise: None,
        effort_per_nm,
    };
    Setup {
        joints: vec![joint; 3],
        model: Some(Model::from_urdf(ARM).unwrap()),
        ..Setup::default()
    }
}

/// A swinging arm under constant motor torques, pushed from `push_s` on. Its twin has friction, and its acceleration
/// is the true one times the factor `acceleration`.
struct Arm {
    model: Model,
    data: Data,
    effort_per_nm: f64,
    acceleration: f64,
    push_s: f64,
    ns: i64,
    q: [f64; 3],
    qd: [f64; 3],
}

impl Arm {
    fn new(effort_per_nm: f64, acceleration: f64, push_s: f64) -> Self {
        let model = Model::from_urdf(ARM).unwrap();
        Self {
            data: Data::new(&model),
            model,
            effort_per_nm,
            acceleration,
            push_s,
            ns: 0,
            q: [0.3, 0.5, -0.4],
            qd: [0.2, 0.0, -0.3],
        }
    }

    /// Simulates `dt_ns` in fine steps and returns the twin's sample.
    fn step(&mut self, dt_ns: i64) -> TwinState {
        let motor = [1.0, -4.0, -2.0];
        let fine = 20;
        let mut qdd = [0.0; 3];
        for i in 0..=fine {
            let dt = if i == 0 {
                0.0
            } else {
                dt_ns as f64 * 1e-9 / f64::from(fine)
            };
            let at_s = self.ns as f64 * 1e-9 + dt * f64::from(i);
            let push = if at_s >= self.push_s { 1.0 } else { 0.0 };
            let total: Vec<f64> = (0..3)
                .map(|j| motor[j] - 0.5 * self.qd[j] + push * EXTERNAL_NM[j])
                .collect();
            let answer =
                forward_dynamics(&self.model, &mut self.data, &self.q, &self.qd, &total, &[]);
            qdd.copy_from_slice(answer);
            for (j, qdd) in qdd.iter().enumerate() {
                self.q[j] += dt * (self.qd[j] + 0.5 * dt * qdd);
                self.qd[j] += dt * qdd;
            }
        }
        self.ns += dt_ns;
        let mut sample = TwinState {
            header: Header {
                stamp_ns: self.ns,
                flags: flags::READY,
                joint_count: 3,
                ..Header::default()
            },
            ..TwinState::default()
        };
        let qdd = qdd.map(|a| a * self.acceleration);
        sample.position[..3].copy_from_slice(&self.q);
        sample.velocity[..3].copy_from_slice(&self.qd);
        sample.acceleration[..3].copy_from_slice(&qdd);
        let rigid = rnea(&self.model, &mut self.data, &self.q, &self.qd, &qdd);
        for j in 0..3 {
            sample.effort[j] = motor[j] * self.effort_per_nm;
            sample.expected_effort[j] = (rigid[j] + 0.5 * self.qd[j]) * self.effort_per_nm;
        }
        sample
    }
}

fn worst(observer: &mut MomentumObserver, sample: &TwinState, share: f64) -> f64 {
    let torque = observer.update(sample);
    let errors = (0..3).map(|j| (torque[j] - share * EXTERNAL_NM[j]).abs());
    errors.fold(0.0, f64::max)
}

#[test]
fn a_constant_external_torque_is_approached_at_the_rate_of_the_gain() {
    let push_s = 0.2;
    let mut arm = Arm::new(1.0, 1.0, push_s);
    let mut observer = MomentumObserver::new(&setup(1.0), 50.0, "test").unwrap();
    for _ in 0..400 {
        let sample = arm.step(1_000_000);
        let since_s = (sample.header.stamp_ns as f64 * 1e-9 - push_s).max(0.0);
        let error = worst(&mut observer, &sample, 1.0 - (-50.0 * since_s).exp());
        assert!(error < 0.03, "{error} N m, {since_s} s after the push");
    }
}

#[test]
fn neither_the_twins_acceleration_nor_an_uneven_clock_changes_the_estimate() {
    let mut arm = Arm::new(1.0, 0.0, 0.0);
    let mut observer = MomentumObserver::new(&setup(1.0), 100.0, "test").unwrap();
    for i in 0..200 {
        let sample = arm.step([400_000, 3_000_000, 1_000_000, 1_700_000][i % 4]);
        let error = worst(&mut observer, &sample, 1.0);
        assert!(i < 60 || error < 0.03, "{error} N m at sample {i}");
    }
}

#[test]
fn a_current_is_turned_into_a_torque() {
    let mut arm = Arm::new(0.1, 1.0, 0.0);
    let mut observer = MomentumObserver::new(&setup(0.1), 100.0, "test").unwrap();
    let mut error = f64::NAN;
    for _ in 0..200 {
        error = worst(&mut observer, &arm.step(1_000_000), 1.0);
    }
    assert!(error < 0.03, "{error} N m");
}

#[test]
fn a_joint_of_unknown_torque_constant_tells_nothing() {
    let mut arm = Arm::new(1.0, 1.0, 0.0);
    let mut setup = setup(1.0);
    setup.joints[1].effort_per_nm = f64::NAN;
    let mut observer = MomentumObserver::new(&setup, 100.0, "test").unwrap();
    let mut torque = [0.0; 3];
    for _ in 0..200 {
        torque.copy_from_slice(&observer.update(&arm.step(1_000_000))[..3]);
    }
    assert!(torque[1].abs() < f64::EPSILON && !observer.knows(1));
    assert!((torque[0] - EXTERNAL_NM[0]).abs() < 0.03 && observer.knows(0));
}

#[test]
fn where_no_torque_is_known_it_says_so_instead_of_telling_nothing() {
    let error = MomentumObserver::new(&setup(f64::NAN), 100.0, "test").unwrap_err();
    assert_eq!(error, ConfigError::NoTorque { detector: "test" });
    assert!(error.to_string().contains("torque_constants_nm_per_a"));
}

#[test]
fn a_reset_forgets_and_a_repeated_stamp_changes_nothing() {
    let mut arm = Arm::new(1.0, 1.0, 0.0);
    let mut observer = MomentumObserver::new(&setup(1.0), 100.0, "test").unwrap();
    for _ in 0..100 {
        observer.update(&arm.step(1_000_000));
    }
    assert!(observer.settled());
    let sample = arm.step(1_000_000);
    let torque = *observer.update(&sample);
    let mut repeated = sample;
    repeated.effort = [99.0; 16];
    assert_eq!(*observer.update(&repeated), torque);
    let mut reset = arm.step(1_000_000);
    reset.header.flags |= flags::RESET;
    assert_eq!(*observer.update(&reset), [0.0; 16]);
    assert!(!observer.settled());
}

#[test]
fn without_a_model_there_is_no_observer() {
    let setup = Setup {
        model: None,
        ..setup(1.0)
    };
    let error = MomentumObserver::new(&setup, 100.0, "test").unwrap_err();
    assert_eq!(error, ConfigError::NoModel { detector: "test" });
}
