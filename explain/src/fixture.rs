//! Recordings of a small arm for tests: a motion, the effort that it requires, and what is added to it.

use tauscope_dynamics::{Data, Model, rnea};

use crate::data::problem::Problem;
use crate::data::track::Track;
use crate::physics::active::{Hypothesis, Whereabouts};
use crate::read::recording::{Losses, Recording};
use crate::report::schema::Finding;

/// Two joints under gravity.
pub const URDF: &str = r#"<robot name="two">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="4"/>
    <inertia ixx="0.06" iyy="0.06" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0 0 0.15"/><mass value="2"/>
    <inertia ixx="0.02" iyy="0.02" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="3" effort="80"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="3" effort="40"/></joint>
</robot>"#;

/// Sample rate, and length of a recording \[s\].
const RATE_HZ: f64 = 100.0;
const LENGTH_S: f64 = 20.0;

/// White noise from a seed, standard deviation 1 (the sum of twelve uniform numbers).
pub struct Noise(pub u64);

impl Noise {
    pub fn next(&mut self) -> f64 {
        let mut uniform = || {
            self.0 ^= self.0 >> 12;
            self.0 ^= self.0 << 25;
            self.0 ^= self.0 >> 27;
            (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

pub fn model() -> Model {
    Model::from_urdf(URDF).unwrap()
}

/// An effect at a joint.
pub fn at_joint(effect: &str, joint: usize) -> Hypothesis {
    Hypothesis {
        effect: tauscope_dynamics::terms::effect(effect).unwrap(),
        place: Whereabouts {
            joint,
            ..Whereabouts::default()
        },
    }
}

/// Simulates a recording of any arm: sums of sines that depend on the seed. `add` receives position and velocity of
/// all joints and changes their effort \[N m\].
pub fn recording(
    model: &Model,
    seed: u64,
    mut add: impl FnMut(&[f64], &[f64], &mut [f64]),
) -> Recording {
    let n = model.dof();
    let mut data = Data::new(model);
    let count = (RATE_HZ * LENGTH_S) as usize;
    let time_s: Vec<f64> = (0..count).map(|k| k as f64 / RATE_HZ).collect();
    let (mut position, mut velocity, mut effort) = (Vec::new(), Vec::new(), Vec::new());
    for &t in &time_s {
        let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        for (j, name) in model.joint_names().enumerate() {
            // By name, so that a joint has the same motion at any place in the URDF.
            let own = name.bytes().map(f64::from).sum::<f64>() % 7.0 + seed as f64;
            for (size, hz) in [(0.5, 0.11 + 0.013 * own), (0.25, 0.37 + 0.029 * own)] {
                let w = std::f64::consts::TAU * hz;
                let (s, c) = (w * t + own).sin_cos();
                q[j] += size * s;
                qd[j] += size * w * c;
                qdd[j] -= size * w * w * s;
            }
        }
        let mut row = rnea(model, &mut data, &q, &qd, &qdd).to_vec();
        add(&q, &qd, &mut row);
        position.extend(q);
        velocity.extend(qd);
        effort.extend(row);
    }
    Recording {
        name: format!("r{seed}"),
        path: std::path::PathBuf::new(),
        start_ns: 60_000_000_000 * seed as i64,
        time_s,
        position,
        velocity,
        effort,
        reference: Vec::new(),
        sample_of_row: (0..count).map(Some).collect(),
        clock: None,
        losses: Losses::default(),
        findings: Vec::new(),
    }
}

/// Prepares some recordings for a fit, standstills included.
pub fn problem(model: &Model, recordings: &[Recording]) -> Problem {
    let n = model.dof();
    let cutoff_hz = Problem::cutoff_hz(recordings);
    let track = |recording: &Recording| {
        let session_s = recording.start_ns as f64 * 1e-9;
        let motion_hz = Problem::motion_cutoff_hz(cutoff_hz);
        Track::new(recording, session_s, model, motion_hz, &vec![1.0; n])
    };
    let tracks = recordings.iter().map(track).collect();
    let ones = vec![1.0; n];
    Problem::new(model, recordings, tracks, cutoff_hz, &ones, &vec![true; n])
}

/// Prepares two recordings of the small arm, changed by `add`, with white noise of 0.05 N m.
pub fn problem_with(seed: u64, mut add: impl FnMut(&[f64], &[f64], &mut [f64])) -> Problem {
    let model = model();
    let mut noise = Noise(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
    let mut noisy = |q: &[f64], qd: &[f64], effort: &mut [f64]| {
        add(q, qd, effort);
        for effort in effort {
            *effort += 0.05 * noise.next();
        }
    };
    let recordings = [
        recording(&model, 2 * seed, &mut noisy),
        recording(&model, 2 * seed + 1, &mut noisy),
    ];
    problem(&model, &recordings)
}

/// Returns a finding of an effect at the first joint, without texts.
pub fn finding(effect: &str) -> Finding {
    Finding {
        effect: effect.to_owned(),
        joint: Some("joint1".to_owned()),
        parameters: [("coulomb_nm".to_owned(), 4.1.into())].into(),
        intervals_95: [("coulomb_nm".to_owned(), [3.9, 4.3])].into(),
        confidence: 0.999,
        explains: 0.63,
        evidence_nats: 40.0,
        effort_rms: 2.0,
        ..Finding::default()
    }
}
