//! Rows at 20 Hz from a stream at any rate: columns and residual of each joint, filtered by the same low-pass.

use nalgebra::Vector3;
use tauscope_bus::{JointArray, MAX_JOINTS, TwinState, flags};
use tauscope_dynamics::lowpass::Butterworth2;
use tauscope_dynamics::terms::sign;
use tauscope_dynamics::{
    Data, JointKind, Model, PARAMETERS_PER_BODY, forward_kinematics, link_jacobian, link_pose,
    regressor,
};

use super::Setup;
use super::moments::JointRow;

/// Averaging time of a row \[ns\].
/// Derived: the Nyquist frequency of 20 rows a second is twice the cutoff of the twin's low-pass, 4.5 Hz by default.
/// Fewer rows would alias the residual; more only cost computing time.
pub(super) const ROW_NS: i64 = 50_000_000;
/// Gap between two rows above which the low-passes are reset \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const LONGEST_GAP_S: f64 = 1.0;
/// Speed below which a revolute joint is at standstill: its friction may have any value within its limits \[rad/s\].
/// Chosen: twice the standstill of single samples, because the velocity varies within a row.
const STANDSTILL_RAD_S: f64 = 2.0 * tauscope_dynamics::terms::STANDSTILL_RAD_S;
/// Speed below which a prismatic joint is at standstill \[m/s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const STANDSTILL_M_S: f64 = 0.005;

/// Columns of a payload.
/// Physical: its mass and its three first moments about the frame of the body that carries it.
pub(super) const PAYLOAD: usize = 4;
/// Columns of a force on a link.
/// Physical: one for each of the world's axes.
pub(super) const FORCE: usize = 3;

/// One instant of the whole arm.
#[derive(Debug, Clone)]
pub(super) struct Row {
    /// Stamp of the row's last sample \[ns since the epoch\].
    pub stamp_ns: i64,
    /// The moving joints: bit j for joint j.
    pub moving: u32,
    /// \[rad\]
    pub position: JointArray,
    /// \[rad/s\]
    pub velocity: JointArray,
    /// Columns and residual, by joint.
    pub joints: Vec<JointRow>,
    /// Columns of a payload, by joint \[effort unit per kg, per kg m\], filtered by the twin's low-pass.
    pub payload: Vec<[f64; PAYLOAD]>,
    /// Columns of a force at a link's centre of mass, by joint and by the link's parent joint \[effort unit per N\].
    pub force: Vec<Vec<[f64; FORCE]>>,
}

/// Sums over the samples of the next row.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: f64,
    stamp_ns: i64,
    first_ns: i64,
    ready: bool,
    position: JointArray,
    velocity: JointArray,
    acceleration: JointArray,
    direction: JointArray,
    expected: JointArray,
    residual: JointArray,
}

/// Averages samples to rows.
#[derive(Debug)]
pub(super) struct Rows {
    joints: usize,
    standstill: Vec<f64>,
    effort_per_nm: Vec<f64>,
    /// Robot model, its workspace, and the joint that carries the tool.
    robot: Option<(Model, Data, usize)>,
    sums: Sums,
    previous_s: Option<f64>,
    start_ns: i64,
    /// Low-passes of direction, velocity and payload columns, by joint.
    filters: Vec<[Butterworth2; 2 + PAYLOAD]>,
    settling_s: f64,
    reset_s: f64,
    row: Row,
}

impl Rows {
    pub fn new(setup: &Setup) -> Self {
        let cutoffs = setup.effort_per_nm.iter().zip(&setup.effort_cutoff_hz);
        let filters: Vec<_> = cutoffs
            .take(MAX_JOINTS)
            .map(|(_, &cutoff_hz)| Butterworth2::new(cutoff_hz))
            .collect();
        let joints = filters.len();
        let settle_s = filters.iter().map(Butterworth2::settling_time_s);
        let prismatic = |j: usize| {
            let model = setup.model.as_ref();
            model.is_some_and(|model| model.joints()[j].kind == JointKind::Prismatic)
        };
        let standstill = (0..joints).map(|j| {
            if prismatic(j) {
                STANDSTILL_M_S
            } else {
                STANDSTILL_RAD_S
            }
        });
        let robot = setup.model.as_ref().and_then(|model| {
            let carrier = model.links()[model.tool_link()].joint?;
            Some((model.clone(), Data::new(model), carrier))
        });
        Self {
            joints,
            standstill: standstill.collect(),
            effort_per_nm: setup.effort_per_nm.clone(),
            robot,
            sums: Sums::default(),
            previous_s: None,
            start_ns: 0,
            settling_s: settle_s.fold(0.0, f64::max),
            reset_s: 0.0,
            filters: (filters.iter())
                .map(|filter| std::array::from_fn(|_| filter.clone()))
                .collect(),
            row: Row {
                stamp_ns: 0,
                moving: 0,
                position: [0.0; MAX_JOINTS],
                velocity: [0.0; MAX_JOINTS],
                joints: vec![JointRow::default(); joints],
                payload: vec![[0.0; PAYLOAD]; joints],
                force: vec![vec![[0.0; FORCE]; joints]; joints],
            },
        }
    }

    /// Drops the samples of the next row and restarts the low-passes.
    pub fn reset(&mut self) {
        self.sums = Sums::default();
        self.previous_s = None;
    }

    /// Processes a sample. Returns the preceding row if it is now complete and valid.
    pub fn take(&mut self, sample: &TwinState) -> Option<&Row> {
        let stamp_ns = sample.header.stamp_ns;
        if sample.header.has(flags::RESET) || stamp_ns < self.sums.stamp_ns {
            self.reset();
        }
        let n = self.joints;
        let whole = |values: &JointArray| values[..n].iter().all(|value| value.is_finite());
        let sound = whole(&sample.residual)
            && whole(&sample.filtered_expected_effort)
            && whole(&sample.position)
            && whole(&sample.velocity)
            && whole(&sample.acceleration);
        if !sound {
            self.reset();
            return None;
        }
        let complete = self.sums.count > 0.0 && stamp_ns - self.sums.first_ns >= ROW_NS;
        let is_row = complete && self.finish();
        if complete {
            self.sums = Sums::default();
        }
        self.add(sample);
        is_row.then_some(&self.row)
    }

    fn add(&mut self, sample: &TwinState) {
        let n = self.joints;
        let sums = &mut self.sums;
        if sums.count == 0.0 {
            sums.first_ns = sample.header.stamp_ns;
            sums.ready = true;
        }
        sums.count += 1.0;
        sums.stamp_ns = sample.header.stamp_ns;
        sums.ready &= sample.header.has(flags::READY);
        for j in 0..n {
            sums.position[j] += sample.position[j];
            sums.velocity[j] += sample.velocity[j];
            sums.acceleration[j] += sample.acceleration[j];
            sums.direction[j] += sign(sample.velocity[j]);
            sums.expected[j] += sample.filtered_expected_effort[j];
            sums.residual[j] += sample.residual[j];
        }
    }

    /// Computes the row from the sums. Returns whether it is valid: the twin was ready and the low-passes have
    /// settled.
    fn finish(&mut self) -> bool {
        let n = self.joints;
        let sums = &mut self.sums;
        for values in [
            &mut sums.position,
            &mut sums.velocity,
            &mut sums.acceleration,
            &mut sums.direction,
            &mut sums.expected,
            &mut sums.residual,
        ] {
            for value in &mut values[..n] {
                *value /= sums.count;
            }
        }
        let middle_ns = sums.first_ns + (sums.stamp_ns - sums.first_ns) / 2;
        if self.previous_s.is_none() {
            self.start_ns = middle_ns;
        }
        let now_s = (middle_ns - self.start_ns) as f64 * 1e-9;
        let dt_s = match self.previous_s {
            Some(before) if now_s - before <= LONGEST_GAP_S => Some(now_s - before),
            _ => {
                self.reset_s = now_s;
                None
            }
        };
        self.previous_s = Some(now_s);
        let columns = self.robot.as_mut().map(|(model, data, carrier)| {
            let motion = regressor(
                model,
                data,
                &sums.position[..n],
                &sums.velocity[..n],
                &sums.acceleration[..n],
            );
            (motion, PARAMETERS_PER_BODY * *carrier)
        });
        let row = &mut self.row;
        row.stamp_ns = sums.stamp_ns;
        row.position = sums.position;
        row.velocity = sums.velocity;
        row.moving = 0;
        for j in 0..n {
            let filters = &mut self.filters[j];
            let mut through = |filter: usize, x: f64| {
                if dt_s.is_none() {
                    filters[filter].reset(x);
                }
                filters[filter].update(dt_s.unwrap_or(0.0), x)
            };
            let direction = through(0, sums.direction[j]);
            let velocity = through(1, sums.velocity[j]);
            let unit = self.effort_per_nm[j];
            if let Some((motion, first)) = columns.filter(|_| unit.is_finite()) {
                for (p, value) in row.payload[j].iter_mut().enumerate() {
                    *value = through(2 + p, unit * motion[(j, first + p)]);
                }
            }
            let expected = sums.expected[j];
            row.joints[j] = JointRow {
                columns: [
                    1.0,
                    expected,
                    direction,
                    velocity,
                    expected.abs() * direction,
                ],
                residual: sums.residual[j],
            };
            if sums.velocity[j].abs() > self.standstill[j] {
                row.moving |= 1 << j;
            }
        }
        let sound = sums.ready && now_s - self.reset_s >= self.settling_s;
        if sound {
            self.forces();
        }
        sound
    }

    /// Computes the columns of a force F on each link: the joints exert -Jᵀ F against it. They are not filtered,
    /// because the Jacobian changes slowly.
    fn forces(&mut self) {
        let Some((model, data, _)) = &mut self.robot else {
            return;
        };
        let n = self.joints;
        forward_kinematics(model, data, &self.row.position[..n]);
        for touched in 0..n {
            let link = model.body_link(touched);
            let lever =
                link_pose(model, data, link).rotation * Vector3::from(model.links()[link].com_m());
            let jacobian = link_jacobian(model, data, link);
            for j in 0..n {
                let unit = self.effort_per_nm[j];
                let unit = if unit.is_finite() { unit } else { 0.0 };
                let turn: Vector3<f64> = jacobian.fixed_view::<3, 1>(3, j).into_owned();
                let column = jacobian.fixed_view::<3, 1>(0, j) + turn.cross(&lever);
                self.row.force[j][touched] = (column * -unit).into();
            }
        }
    }
}
