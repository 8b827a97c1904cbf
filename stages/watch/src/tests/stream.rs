//! Synthetic twin states of the demonstration arm: a motion, the measured effort of an arm that changes, and the
//! expected effort of a twin with small errors.

use tauscope_bus::{Header, TwinState, flags};
use tauscope_dynamics::lowpass::Butterworth2;
use tauscope_dynamics::terms::sign;
use tauscope_dynamics::{Data, Inertia, Model, forward_kinematics, link_jacobian, link_pose, rnea};

/// Coulomb friction of the arm, by joint \[N m\].
/// Chosen: for this simulated arm only; about 1 % of each joint's effort limit.
const COULOMB_NM: [f64; 7] = [0.9, 0.9, 0.6, 0.5, 0.25, 0.2, 0.1];
/// Viscous friction of the arm, by joint \[N m s/rad\].
/// Tuned: as [`COULOMB_NM`].
const VISCOUS: [f64; 7] = [1.4, 1.5, 0.8, 0.7, 0.3, 0.25, 0.1];

/// A change of the arm, or a contact.
#[derive(Debug, Clone, Copy)]
pub enum Act {
    /// \[N m\] more at a joint.
    Coulomb(usize, f64),
    /// \[N m s/rad\] more at a joint.
    Viscous(usize, f64),
    /// A factor at a joint.
    Gain(usize, f64),
    /// \[kg\] at this place of the tool \[m\].
    Payload(f64, [f64; 3]),
    /// A force on a link, world frame \[N\].
    Push(usize, [f64; 3]),
}

/// A change or contact with its start and end \[s\].
#[derive(Debug, Clone, Copy)]
pub struct Episode {
    pub act: Act,
    pub from_s: f64,
    pub until_s: f64,
}

/// A stream of twin states.
pub struct Stream {
    pub nominal: Model,
    data: Data,
    real: Model,
    real_data: Data,
    loaded: Model,
    pub episodes: Vec<Episode>,
    pub rate_hz: f64,
    /// Standard deviation of the white noise as a share of each joint's effort limit; half as much is correlated.
    pub noise: f64,
    /// Whether the twin has a friction model.
    pub calibrated: bool,
    /// Share by which the viscous friction falls as the arm warms up, with a time constant of 20 minutes.
    pub warm_up: f64,
    /// Period between changes of the motion \[s\].
    pub program_s: f64,
    /// Duration of the rest at the end of each period \[s\].
    pub rest_s: f64,
    pub seed: u64,
    step: u64,
    random: Random,
    coloured: [f64; 7],
    filters: Vec<[Butterworth2; 2]>,
}

/// xorshift64* random numbers; the sum of four uniform ones approximates a normal one.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        ((0..4).map(|_| self.uniform()).sum::<f64>() - 2.0) * 3.0_f64.sqrt()
    }
}

impl Stream {
    pub fn new(seed: u64) -> Self {
        let urdf = include_str!("../../../../tests/data/demo_arm.urdf");
        let nominal = Model::from_urdf(urdf).unwrap();
        let mut real = nominal.clone();
        // Remaining errors of a calibrated twin.
        for (link, mass, com) in [
            ("link2", 0.12, [0.02, 0.0, 0.1]),
            ("link4", 0.08, [0.0, 0.03, 0.05]),
            ("link6", 0.05, [0.0, 0.0, 0.05]),
        ] {
            let link = real.link_index(link).unwrap();
            real.attach(link, Inertia::new(mass, com, [0.0; 6]));
        }
        Self {
            data: Data::new(&nominal),
            real_data: Data::new(&real),
            loaded: real.clone(),
            real,
            nominal,
            episodes: Vec::new(),
            rate_hz: 100.0,
            noise: 0.003,
            calibrated: true,
            warm_up: 0.0,
            program_s: f64::INFINITY,
            rest_s: 0.0,
            seed,
            step: 0,
            random: Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1),
            coloured: [0.0; 7],
            filters: vec![[Butterworth2::new(4.0), Butterworth2::new(4.0)]; 7],
        }
    }

    pub fn with(mut self, act: Act, from_s: f64, until_s: f64) -> Self {
        self.episodes.push(Episode {
            act,
            from_s,
            until_s,
        });
        if let Act::Payload(mass, com) = act {
            let tool = self.loaded.tool_link();
            self.loaded.attach(tool, Inertia::new(mass, com, [0.0; 6]));
        }
        self
    }

    pub fn time_s(&self) -> f64 {
        self.step as f64 / self.rate_hz
    }

    /// Position, velocity and acceleration: four harmonics that differ between programs, at rest at the ends of a
    /// period.
    fn motion(&self, t: f64) -> [[f64; 7]; 3] {
        let program = (t / self.program_s).floor();
        let mut random =
            Random((self.seed ^ ((program as u64) << 32)).wrapping_mul(0xD129_0DDA_53C4_3E49) | 1);
        random.uniform();
        let mut result = [[0.0; 7]; 3];
        let period_s = 8.0 + 8.0 * random.uniform();
        let reach = 0.5 + 0.5 * random.uniform();
        // The arm stands still at the end of a period.
        let local = t % (period_s + self.rest_s);
        let local = local.min(period_s);
        for j in 0..7 {
            let centre = 1.2 * (random.uniform() - 0.5);
            result[0][j] = centre;
            for k in 1..=4 {
                let w = std::f64::consts::TAU * f64::from(k) / period_s;
                // Sines and cosines minus their value at the ends, so that velocities vanish there.
                let a = reach * 0.5 * random.normal() / f64::from(k * k);
                let b = reach * 0.15 * random.normal() / f64::from(k * k);
                let (s, c) = (w * local).sin_cos();
                let taper = (std::f64::consts::PI * local / period_s).sin().powi(2);
                let taper_d = std::f64::consts::PI / period_s
                    * (std::f64::consts::TAU * local / period_s).sin();
                let taper_dd = std::f64::consts::TAU * std::f64::consts::PI / period_s / period_s
                    * (std::f64::consts::TAU * local / period_s).cos();
                let (f, fd, fdd) = (
                    a * s + b * (c - 1.0),
                    w * (a * c - b * s),
                    -w * w * (a * s + b * c),
                );
                result[0][j] += taper * f;
                result[1][j] += taper_d * f + taper * fd;
                result[2][j] += taper_dd * f + 2.0 * taper_d * fd + taper * fdd;
            }
        }
        result
    }

    fn acts(&self, t: f64) -> impl Iterator<Item = Act> {
        let now = move |episode: &&Episode| episode.from_s <= t && t < episode.until_s;
        self.episodes.iter().filter(now).map(|episode| episode.act)
    }

    /// Returns the measured effort.
    fn effort(&mut self, t: f64, [q, qd, qdd]: &[[f64; 7]; 3]) -> [f64; 7] {
        let loaded = self.acts(t).any(|act| matches!(act, Act::Payload(..)));
        let model = if loaded { &self.loaded } else { &self.real };
        let mut effort = [0.0; 7];
        effort.copy_from_slice(rnea(model, &mut self.real_data, q, qd, qdd));
        let warm = 1.0 - self.warm_up * (1.0 - (-t / 1200.0).exp());
        for j in 0..7 {
            let direction = sign(qd[j]);
            let stribeck = 1.0 + 0.3 * (-(qd[j] / 0.08).powi(2)).exp();
            let load = 0.02 * effort[j].abs();
            effort[j] += (1.05 * COULOMB_NM[j] * stribeck + load) * direction;
            effort[j] += 0.95 * warm * VISCOUS[j] * qd[j];
            effort[j] += 0.05 * COULOMB_NM[j] * (16.0 * q[j]).sin();
        }
        let acts: Vec<Act> = self.acts(t).collect();
        for act in &acts {
            match *act {
                Act::Coulomb(j, more) => effort[j] += more * sign(qd[j]),
                Act::Viscous(j, more) => effort[j] += more * qd[j],
                Act::Push(link, force) => {
                    let (model, data) = (&self.real, &mut self.real_data);
                    forward_kinematics(model, data, q);
                    let lever = link_pose(model, data, link).rotation
                        * nalgebra::Vector3::from(model.links()[link].com_m());
                    let jacobian = link_jacobian(model, data, link);
                    let force = nalgebra::Vector3::from(force);
                    for (j, effort) in effort.iter_mut().enumerate() {
                        let turn: nalgebra::Vector3<f64> =
                            jacobian.fixed_view::<3, 1>(3, j).into_owned();
                        let column = jacobian.fixed_view::<3, 1>(0, j) + turn.cross(&lever);
                        *effort -= column.dot(&force);
                    }
                }
                Act::Payload(..) | Act::Gain(..) => {}
            }
        }
        for act in &acts {
            if let Act::Gain(j, gain) = *act {
                effort[j] *= gain;
            }
        }
        let share = (-1.0 / self.rate_hz).exp();
        for j in 0..7 {
            let limit = self.nominal.joints()[j].limits.effort.unwrap();
            self.coloured[j] = share * self.coloured[j]
                + (1.0 - share * share).sqrt() * self.random.normal() * 0.5;
            effort[j] += self.noise * limit * (self.random.normal() + self.coloured[j]);
        }
        effort
    }

    /// Returns whether any joint moves at the next sample.
    pub fn is_moving(&self) -> bool {
        self.motion(self.time_s())[1].iter().any(|v| v.abs() > 0.02)
    }

    /// Returns the next sample.
    pub fn next_sample(&mut self) -> TwinState {
        let t = self.time_s();
        let motion = self.motion(t);
        let [q, qd, qdd] = &motion;
        let effort = self.effort(t, &motion);
        let mut expected = [0.0; 7];
        expected.copy_from_slice(rnea(&self.nominal, &mut self.data, q, qd, qdd));
        if self.calibrated {
            for j in 0..7 {
                expected[j] += COULOMB_NM[j] * sign(qd[j]) + VISCOUS[j] * qd[j];
            }
        }
        let dt_s = 1.0 / self.rate_hz;
        let mut sample = TwinState {
            header: Header {
                stamp_ns: (t * 1e9).round() as i64 + 1_000_000_000,
                received_ns: 0,
                sequence: self.step,
                flags: flags::EFFORT_MEASURED,
                joint_count: 7,
            },
            ..TwinState::default()
        };
        sample.header.flags |= if self.step == 0 { flags::RESET } else { 0 };
        sample.header.flags |= if t > 0.5 { flags::READY } else { 0 };
        for j in 0..7 {
            sample.position[j] = q[j];
            sample.velocity[j] = qd[j] + 0.001 * self.random.normal();
            sample.acceleration[j] = qdd[j];
            sample.effort[j] = effort[j];
            sample.expected_effort[j] = expected[j];
            let [measured, model] = &mut self.filters[j];
            sample.filtered_effort[j] = measured.update(dt_s, effort[j]);
            sample.filtered_expected_effort[j] = model.update(dt_s, expected[j]);
            sample.residual[j] = sample.filtered_effort[j] - sample.filtered_expected_effort[j];
        }
        self.step += 1;
        sample
    }
}
