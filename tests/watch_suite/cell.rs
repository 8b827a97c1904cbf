//! A simulated cell, drawn from a seed.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use tauscope_archive::ros::JointState;
use tauscope_archive::{Compression, McapWriter, Recording};
use tauscope_dynamics::Model;

use crate::common::{Out, root, tauscope, write};

const STATES: &str = "/joint_states";
/// Speed above which a joint moves \[rad/s\].
pub const MOVES_RAD_S: f64 = 0.02;

/// Arms, with the range of their payloads \[kg\].
const ROBOTS: [(&str, Range<f64>); 3] = [
    ("tests/data/demo_arm.urdf", 0.4..2.0),
    ("tests/proof/robots/seven.urdf", 0.4..2.0),
    ("tests/proof/robots/six.urdf", 1.0..5.0),
];
const RATES_HZ: [f64; 3] = [100.0, 500.0, 1000.0];

/// A change of the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Change {
    /// Additional friction at a joint \[N m\].
    Friction(usize, f64),
    /// Factor on the measured effort of a joint.
    Gain(usize, f64),
    /// Additional mass \[kg\].
    Payload(f64),
    Nothing,
}

/// A simulated cell, drawn from a seed.
pub struct Cell {
    seed: u64,
    pub rng: ChaCha8Rng,
    pub urdf: PathBuf,
    pub model: Model,
    pub rate_hz: f64,
    /// Standard deviation of the effort's white noise, as a fraction of each joint's limit.
    noise: f64,
    payload_kg: Range<f64>,
}

impl Cell {
    /// Draws the cell of `seed`. Nine consecutive seeds cover all combinations of robot and rate.
    pub fn new(seed: u64) -> Self {
        let turn = seed as usize;
        let (file, payload_kg) = ROBOTS[turn % 3].clone();
        let urdf = root().join(file);
        let model = Model::from_urdf(&std::fs::read_to_string(&urdf).unwrap()).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        Self {
            seed,
            noise: rng.random_range(0.001..0.003),
            rng,
            urdf,
            model,
            rate_hz: RATES_HZ[turn / 3 % 3],
            payload_kg,
        }
    }

    pub fn within(&mut self, range: Range<f64>) -> f64 {
        self.rng.random_range(range)
    }

    fn limit_nm(&self, j: usize) -> f64 {
        self.model.joints()[j].limits.effort.unwrap()
    }

    pub fn joint(&self, j: usize) -> &str {
        &self.model.joints()[j].name
    }

    /// Physics that the URDF leaves out: friction in all joints, more of it in the cold, and small errors of the
    /// bodies.
    pub fn physics(&mut self) -> Vec<Value> {
        let mut physics = Vec::new();
        for j in 0..self.model.dof() {
            let limit = self.limit_nm(j);
            let joint = self.joint(j).to_owned();
            let mut add = |effect: &str, parameters: Value| {
                physics.push(json!({"effect": effect, "joint": joint, "parameters": parameters}));
            };
            let coulomb_nm = limit * self.within(0.007..0.013);
            if self.rng.random_bool(0.5) {
                add("coulomb_friction", json!({"coulomb_nm": coulomb_nm}));
            } else {
                let static_nm = coulomb_nm * self.within(1.1..1.5);
                let stribeck = json!({"coulomb_nm": coulomb_nm, "static_nm": static_nm, "stribeck_velocity_rad_s": 0.08});
                add("stribeck_friction", stribeck);
            }
            let viscous = limit * self.within(0.008..0.016);
            let cold = viscous * self.within(0.1..0.5);
            let constant_s = self.within(300.0..1500.0);
            let warm_up = json!({"viscous_warm_nms_per_rad": viscous, "viscous_extra_cold_nms_per_rad": cold, "time_constant_s": constant_s});
            add("temperature_viscous", warm_up);
            if self.rng.random_bool(0.3) {
                let coefficient = self.within(0.01..0.04);
                add(
                    "load_dependent_friction",
                    json!({"coefficient": coefficient}),
                );
            }
        }
        for j in 1..self.model.dof() - 1 {
            let link = self.model.joints()[j].child_link;
            let mass_kg = self.model.links()[link].mass_kg() * self.within(-0.04..0.04);
            let link = &self.model.links()[link].name;
            physics.push(json!({"effect": "link_mass", "link": link, "parameters": {"delta_mass_kg": mass_kg}}));
        }
        physics
    }

    pub fn motion(&mut self) -> Value {
        let speed = self.within(0.3..0.6);
        let acceleration_rad_s2 = self.within(2.0..5.0);
        let range = self.within(0.3..0.6);
        if self.rng.random_bool(0.5) {
            let period_s = self.within(7.0..14.0);
            let harmonics = self.rng.random_range(3..=5);
            json!({"fourier": {"period_s": period_s, "harmonics": harmonics, "speed": speed, "acceleration_rad_s2": acceleration_rad_s2, "range": range}})
        } else {
            let rest_s = [0.0, self.within(0.1..0.8)];
            // Some cells repeat a list of points, others never repeat a position.
            let mut points = json!({"speed": speed, "acceleration_rad_s2": acceleration_rad_s2, "range": range, "rest_s": rest_s});
            if self.rng.random_bool(0.5) {
                points["through"] = json!(self.list(range));
            }
            json!({"points": points})
        }
    }

    /// Six positions within a share of each joint's range.
    fn list(&mut self, range: f64) -> Vec<Vec<f64>> {
        let n = self.model.dof();
        (0..6)
            .map(|_| {
                (0..n)
                    .map(|j| {
                        let limits = &self.model.joints()[j].limits;
                        let (low, high) = (limits.lower.unwrap(), limits.upper.unwrap());
                        0.5 * (low + high) + 0.5 * range * self.within(-1.0..1.0) * (high - low)
                    })
                    .collect()
            })
            .collect()
    }

    /// A push of 1 to 5 s that begins at a time.
    pub fn push(&mut self, t_on_s: f64) -> Value {
        let j = self.rng.random_range(2..self.model.dof());
        let link = self.model.joints()[j].child_link;
        let force: [f64; 3] = std::array::from_fn(|_| self.within(-1.0..1.0));
        let size = force.iter().map(|f| f * f).sum::<f64>().sqrt();
        let wanted = self.within(10.0..40.0) * if self.model.dof() == 6 { 2.0 } else { 1.0 };
        let lasts_s = self.within(0.5..5.0);
        json!({"link": self.model.links()[link].name, "force_n": force.map(|f| f / size * wanted), "t_on_s": t_on_s, "t_off_s": t_on_s + lasts_s})
    }

    /// Simulates a recording of this physics, with coloured noise and changes of the gain.
    pub fn simulate(
        &mut self,
        folder: &Path,
        physics: &[Value],
        recording: &Value,
        change: Change,
        at_s: f64,
    ) -> PathBuf {
        let scenario = json!({
            "version": 1, "robot": self.urdf, "seed": self.seed, "rate_hz": self.rate_hz, "physics": physics,
            "sensors": {"position_noise_rad": 1e-5, "velocity_noise_rad_s": 0.001, "effort_noise_of_limit": self.noise},
            "recordings": [recording],
        });
        let file = write(&folder.join("scenario.yaml"), &scenario.to_string());
        let mut simulate = tauscope();
        simulate.arg("simulate").arg(file).arg("--force");
        simulate.arg("--out").arg(folder);
        done(simulate);
        let name = recording["name"].as_str().unwrap();
        let white = folder.join(format!("{name}.mcap"));
        let coloured = folder.join(format!("{name}_coloured.mcap"));
        self.colour(&white, &coloured, change, at_s);
        std::fs::remove_file(white).unwrap();
        coloured
    }

    /// Adds coloured noise to the efforts, half as strong as the white one, and applies a step of the gain.
    fn colour(&mut self, from: &Path, to: &Path, change: Change, at_s: f64) {
        let mut writer = McapWriter::create(to, Compression::None, &BTreeMap::new()).unwrap();
        let topic = writer.add_topic::<JointState>(STATES).unwrap();
        let mut coloured = vec![0.0; self.model.dof()];
        let share = (-1.0 / self.rate_hz / 0.7).exp();
        rows(from, |since_s, message| {
            let mut message = message.clone();
            for (j, coloured) in coloured.iter_mut().enumerate() {
                // The sum of three is nearly normal.
                let normal: f64 = (0..3).map(|_| self.within(-1.0..1.0)).sum();
                *coloured = share * *coloured + (1.0 - share * share).sqrt() * normal;
                let place = message
                    .name
                    .iter()
                    .position(|name| name == self.joint(j))
                    .unwrap();
                let effort = &mut message.effort[place];
                *effort += 0.5 * self.noise * self.limit_nm(j) * *coloured;
                if let Change::Gain(at, factor) = change
                    && at == j
                    && since_s >= at_s
                {
                    *effort *= factor;
                }
            }
            let stamp_ns = message.header.stamp.ns();
            writer.write(topic, stamp_ns, stamp_ns, &message).unwrap();
        });
        writer.finish().unwrap();
    }

    /// Draws a change, of friction, gain and payload in turn, with the corresponding physics of the plant.
    pub fn change(&mut self, at_s: f64, ends_s: f64, physics: &mut Vec<Value>) -> Change {
        match self.seed / 9 % 3 {
            0 => {
                let j = self.rng.random_range(0..self.model.dof());
                let is = |value: &&mut Value| {
                    value["joint"] == self.model.joints()[j].name.as_str()
                        && value["effect"] != "temperature_viscous"
                        && value["effect"] != "load_dependent_friction"
                };
                let before = physics.iter_mut().find(is).unwrap();
                let before_nm = before["parameters"]["coulomb_nm"].as_f64().unwrap();
                // Mostly an increase; a decrease represents new grease.
                let factor = if self.rng.random_bool(0.75) {
                    self.within(1.6..2.5)
                } else {
                    self.within(0.2..0.5)
                };
                *before = json!({"effect": "friction_step", "joint": self.joint(j), "parameters": {
                    "coulomb_before_nm": before_nm, "coulomb_after_nm": factor * before_nm, "change_time_session_s": at_s}});
                Change::Friction(j, (factor - 1.0) * before_nm)
            }
            1 => {
                let j = self.rng.random_range(0..self.model.dof());
                let off = self.within(0.07..0.15);
                Change::Gain(
                    j,
                    if self.rng.random_bool(0.5) {
                        1.0 + off
                    } else {
                        1.0 - off
                    },
                )
            }
            _ => {
                let mass_kg = self.within(self.payload_kg.clone());
                let puts_down = self.rng.random_bool(0.35);
                let (from_s, to_s) = if puts_down {
                    (-1.0, at_s)
                } else {
                    (at_s, ends_s + 1.0)
                };
                let inertia = 0.002 * mass_kg;
                let [x, y, z] = [
                    self.within(-0.04..0.04),
                    self.within(-0.04..0.04),
                    self.within(0.0..0.1),
                ];
                physics.push(json!({"effect": "payload_pickup", "link": "tool", "parameters": {
                    "mass_kg": mass_kg, "com_x_m": x, "com_y_m": y, "com_z_m": z, "ixx_kgm2": inertia, "iyy_kgm2": inertia,
                    "izz_kgm2": inertia, "t_start_s": from_s, "t_end_s": to_s}}));
                Change::Payload(if puts_down { -mass_kg } else { mass_kg })
            }
        }
    }

    /// Root mean square of the effort of a change of one joint, in units of the coloured noise, the only noise below
    /// the twin's low-pass; NaN for a payload.
    pub fn strength(&self, change: Change, recording: &Path, at_s: f64) -> f64 {
        let (j, mut square, mut count) = match change {
            Change::Friction(j, _) | Change::Gain(j, _) => (j, 0.0, 0.0),
            Change::Payload(_) | Change::Nothing => return f64::NAN,
        };
        rows(recording, |since_s, message| {
            let place = message
                .name
                .iter()
                .position(|name| name == self.joint(j))
                .unwrap();
            if since_s < at_s || message.velocity[place].abs() < MOVES_RAD_S {
                return;
            }
            let added = match change {
                Change::Gain(_, factor) => (factor - 1.0) * message.effort[place],
                Change::Friction(_, more_nm) => more_nm,
                _ => 0.0,
            };
            square += added * added;
            count += 1.0;
        });
        (square / f64::max(count, 1.0)).sqrt() / (0.5 * self.noise * self.limit_nm(j))
    }
}

/// Runs a command that must succeed; returns its output.
pub fn done(command: Command) -> String {
    let words = format!("{command:?}");
    let out = Out::of(command);
    assert_eq!(out.code, 0, "{words}: {}", out.stderr);
    out.stdout
}

/// Calls `see` with every joint state of a recording and its time \[s\].
pub fn rows(recording: &Path, mut see: impl FnMut(f64, &JointState)) {
    let recording = Recording::open(recording).unwrap();
    let mut states = recording.joint_states(STATES).unwrap();
    let mut first_ns = None;
    while let Some(state) = states.next_state() {
        let state = state.unwrap();
        let now_ns = state.log_time_ns;
        let since_s = (now_ns - *first_ns.get_or_insert(now_ns)) as f64 * 1e-9;
        see(since_s, state.message);
    }
}
