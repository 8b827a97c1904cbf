//! Detector `tauscope`: it determines joints and link of a contact from all samples of the contact.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::common::{Out, setup};
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tauscope_bus::{Contact, ContactFollower, Stage, TwinState, flags};
use tauscope_detect::{Config, Lesson, Lessons, Setup, tauscope};
use tauscope_dynamics::{Data, Model, forward_kinematics, point_jacobian};

const JOINTS: usize = 4;
const STEP_NS: i64 = 10_000_000;
const POSTURE: [f64; JOINTS] = [0.4, 0.8, 0.6, 0.3];
/// Indices of the samples with contact.
const CONTACT: std::ops::Range<usize> = 1000..1060;

/// An arm with links of half a metre and a short hand.
const ARM: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="shoulder"><inertial><origin xyz="0 0 0.1"/><mass value="3"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0 0 0.25"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0 0 0.25"/><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="hand"><inertial><origin xyz="0 0.1 0.05"/><mass value="0.5"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <joint name="a" type="continuous"><parent link="base"/><child link="shoulder"/><axis xyz="0 0 1"/></joint>
  <joint name="b" type="continuous"><origin xyz="0 0 0.2"/><parent link="shoulder"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <joint name="c" type="continuous"><origin xyz="0 0 0.5"/><parent link="upper"/><child link="fore"/><axis xyz="0 1 0"/></joint>
  <joint name="d" type="continuous"><origin xyz="0 0 0.5"/><parent link="fore"/><child link="hand"/><axis xyz="1 0 0"/></joint>
</robot>"#;

fn quiet(seed: u64, samples: usize) -> Vec<TwinState> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let sample = |k: usize| {
        let mut sample = TwinState::default();
        sample.header.stamp_ns = k as i64 * STEP_NS;
        sample.header.joint_count = JOINTS as u32;
        sample.header.flags = flags::READY;
        sample.position[..JOINTS].copy_from_slice(&POSTURE);
        for j in 0..JOINTS {
            sample.velocity[j] = (0.01 * k as f64 + j as f64).sin();
            let sum: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
            sample.effort[j] = 0.05 * sum;
        }
        sample
    };
    (0..samples).map(sample).collect()
}

/// Returns the contact detected for a push of 25 N on the forearm. Adds `extra_nm` to the effort of the last joint in
/// sample `k` of the contact \[N m\].
fn contact(extra_nm: impl Fn(usize) -> f64) -> Contact {
    let model = Model::from_urdf(ARM).unwrap();
    let cell = Setup {
        model: Some(model.clone()),
        ..setup(JOINTS)
    };
    let train = [1, 2].map(|seed| Lesson {
        name: "rec".to_owned(),
        samples: quiet(seed, 6000),
        contacts: Some(Vec::new()),
    });
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    let learnt = tauscope::learn(&tauscope::Settings::default(), &cell, &lessons).unwrap();
    let mut data = Data::new(&model);
    forward_kinematics(&model, &mut data, &POSTURE);
    let (point, force) = (Vector3::new(0.0, 0.03, 0.3), Vector3::new(12.0, -20.0, 9.0));
    let mut samples = quiet(3, 1200);
    for (k, sample) in samples[CONTACT].iter_mut().enumerate() {
        point_jacobian(&model, &data, 3, &point, |j, linear, _| {
            sample.effort[j] -= linear.dot(&force);
        });
        sample.effort[3] += extra_nm(k);
    }
    let mut detect = Config::of(learnt).stage(cell).unwrap();
    let mut out = Out::default();
    for sample in &samples {
        detect.accept(sample, &mut out).unwrap();
    }
    let mut follower = ContactFollower::default();
    let mut ended = out
        .0
        .iter()
        .filter_map(|detection| follower.push(detection));
    let contact = ended.next().unwrap();
    assert!(ended.next().is_none());
    contact
}

#[test]
fn no_force_is_promised_on_a_link_whose_joint_has_no_measured_effort() {
    let cell = Setup {
        model: Some(Model::from_urdf(ARM).unwrap()),
        ..setup(JOINTS)
    };
    let mut samples = quiet(1, 6000);
    for sample in &mut samples {
        sample.effort[3] = 0.0;
    }
    let train = [Lesson {
        name: "rec".to_owned(),
        samples,
        contacts: Some(Vec::new()),
    }];
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    let learnt = tauscope::learn(&tauscope::Settings::default(), &cell, &lessons).unwrap();
    let smallest = learnt.smallest_forces(5.0);
    let links: Vec<&str> = smallest
        .iter()
        .map(|of_link| of_link.link.as_str())
        .collect();
    assert_eq!(links, ["shoulder", "upper", "fore"]);
}

#[test]
fn a_joint_that_carries_nothing_of_a_push_is_not_listed() {
    let contact = contact(|_| 0.0);
    assert_eq!(contact.joints, 0b0111);
    assert_eq!(contact.link.as_str(), "fore");
}

#[test]
fn eight_erring_samples_of_an_outer_joint_move_neither_joints_nor_link() {
    // As during a reversal of that joint, where its friction is least certain.
    let contact = contact(|k| if (20..28).contains(&k) { 0.6 } else { 0.0 });
    assert_eq!(contact.joints, 0b0111);
    assert_eq!(contact.link.as_str(), "fore");
}
