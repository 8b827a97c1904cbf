//! One recording of a simulated cell, instant by instant.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tauscope_bus::{JointArray, MAX_JOINTS};
use tauscope_dynamics::{Data, Inertia, Model, forward_kinematics, link_pose};

use super::controller::Controller;
use super::error::ScenarioError;
use super::plant::{Contact, Plant};
use super::push::{Push, find_link, pushes};
use super::scenario::{RecordedMotionSpec, RecordingSpec, Scenario};
use super::sensors::SensorBank;
use super::trajectory::{Allowed, Fourier, JointRange, Points, Spline, Target, Trajectory};
use crate::config::{Config, FileConfig, Topics};
use crate::recorded::RecordedSource;
use crate::setup::Setup;

/// The plant is integrated at 4 kHz; its controller runs at 1 kHz.
const STEP_NS: i64 = 250_000;
const STEPS_PER_CONTROL: i64 = 4;
/// Between two recordings of a session \[ns\].
const PAUSE_NS: i64 = 10_000_000_000;
/// Faster than this and the arm has run away \[rad/s or m/s\].
const RUNAWAY: f64 = 100.0;
/// Range of a joint without limits \[rad\], and velocity of one without \[rad/s\].
const FREE_RANGE: f64 = std::f64::consts::PI;
const FREE_VELOCITY: f64 = 2.0;
/// Random streams of one recording.
const STREAMS: u64 = 8;

/// What the cell publishes at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// \[ns since the epoch\]
    pub stamp_ns: i64,
    /// Measured position \[rad\].
    pub position: JointArray,
    /// Measured velocity \[rad/s\].
    pub velocity: JointArray,
    /// Measured effort in the scenario's unit.
    pub effort: JointArray,
    /// Commanded position \[rad\].
    pub command_position: JointArray,
    /// Whether a push acts.
    pub contact: bool,
}

/// A push as the labels tell of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// When it begins \[s from the first reading\].
    pub on_s: f64,
    /// When it has ended \[s from the first reading\].
    pub off_s: f64,
    /// What it is called.
    pub kind: String,
    /// The link that is touched.
    pub link: String,
    /// Where, at its peak, in the world frame \[m\].
    pub point_m: [f64; 3],
    /// Force on the robot at its peak, world frame \[N\].
    pub force_n: [f64; 3],
}

/// A recording in the making.
#[derive(Debug)]
pub struct Simulation {
    name: String,
    joints: Vec<JointRange>,
    start_ns: i64,
    step: i64,
    last_step: i64,
    next_sample: i64,
    rate_hz: f64,
    trajectory: Trajectory,
    target: Target,
    controller: Controller,
    plant: Plant,
    sensors: SensorBank,
    pushes: Vec<Push>,
    events: Vec<Event>,
}

impl Simulation {
    /// The recording with this place in the scenario, of the robot that it names.
    ///
    /// # Errors
    /// If the scenario does not fit the robot, or asks for what cannot be.
    pub fn new(scenario: &Scenario, model: &Model, index: usize) -> Result<Self, ScenarioError> {
        let spec = &scenario.recordings[index];
        let joints = joint_ranges(model)?;
        let rng = |stream: u64| {
            let mut rng = ChaCha8Rng::seed_from_u64(scenario.seed);
            rng.set_stream(index as u64 * STREAMS + stream);
            rng
        };
        let model = with_tool(scenario, model)?;
        let mut trajectory = trajectory(spec, &model, &joints, rng(0))?;
        let target = trajectory.at(0.0);
        let start = &target.position[..joints.len()];
        let pushes = pushes(spec, &model, rng(1))?;
        let offset_ns = scenario.recordings[..index]
            .iter()
            .map(|before| whole_steps(before.duration_s) * STEP_NS + PAUSE_NS)
            .sum::<i64>();
        Ok(Self {
            name: spec.name.clone(),
            start_ns: i64::from(scenario.start_s) * 1_000_000_000 + offset_ns,
            step: 0,
            last_step: whole_steps(spec.duration_s),
            next_sample: 0,
            rate_hz: scenario.rate_hz,
            controller: Controller::new(&model, &scenario.controller, &joints, start),
            plant: Plant::new(&model, &scenario.physics, start)?
                .starting_at(offset_ns as f64 * 1e-9),
            sensors: SensorBank::new(scenario, &joints, rng(2))?,
            trajectory,
            target,
            events: Vec::with_capacity(pushes.len()),
            pushes,
            joints,
        })
    }

    /// The next instant that is published; `None` at the end.
    ///
    /// # Errors
    /// [`ScenarioError::Unstable`] if the arm runs away.
    pub fn next_reading(&mut self) -> Result<Option<Reading>, ScenarioError> {
        while self.step <= self.last_step {
            let time_s = self.time_s();
            if self.step % STEPS_PER_CONTROL == 0 {
                self.target = self.trajectory.at(time_s);
                let dt_s = (STEPS_PER_CONTROL * STEP_NS) as f64 * 1e-9;
                self.controller
                    .update(dt_s, &self.target, self.plant.position());
            }
            let due = self.step >= self.next_sample;
            let reading = due.then(|| self.read(time_s));
            self.advance(time_s)?;
            if reading.is_some() {
                return Ok(reading);
            }
        }
        Ok(None)
    }

    /// The pushes that have passed their peak so far.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// How much of the recording has been made, 0 to 1.
    pub fn fraction_done(&self) -> f64 {
        (self.step as f64 / self.last_step as f64).min(1.0)
    }

    fn time_s(&self) -> f64 {
        (self.step * STEP_NS) as f64 * 1e-9
    }

    fn read(&mut self, time_s: f64) -> Reading {
        let n = self.joints.len();
        // The instants of the rate, each moved to the next step of the plant.
        let index = (time_s * self.rate_hz + 1e-6).floor() + 1.0;
        self.next_sample = (index / self.rate_hz * 1e9 / STEP_NS as f64 - 1e-6).ceil() as i64;
        // Before the first step there is no effort but the controller's.
        let effort_nm = match self.step {
            0 => &self.controller.drive(0.0).effort_nm[..n],
            _ => self.plant.applied_nm(),
        };
        let measured =
            self.sensors
                .measure(self.plant.position(), self.plant.velocity(), effort_nm);
        Reading {
            stamp_ns: self.start_ns + self.step * STEP_NS,
            position: measured.position,
            velocity: measured.velocity,
            effort: measured.effort,
            command_position: self.sensors.in_steps(&self.target.position),
            contact: self.pushes.iter().any(|push| push.acts(time_s)),
        }
    }

    /// Moves the plant on by one step.
    fn advance(&mut self, time_s: f64) -> Result<(), ScenarioError> {
        let n = self.joints.len();
        let contacts = self.pushes.iter().filter(|push| push.acts(time_s));
        let contacts = contacts.map(|push| {
            let share = push.share(time_s);
            Contact {
                link: push.link,
                point_m: push.point_m,
                force_n: push.force_n.map(|f| share * f),
            }
        });
        let dt_s = STEP_NS as f64 * 1e-9;
        let since_target = self.step % STEPS_PER_CONTROL + 1;
        let drive = self.controller.drive(since_target as f64 * dt_s);
        self.plant.step(dt_s, &drive, contacts);
        let velocity = self.plant.velocity();
        if let Some(j) = (0..n).find(|&j| velocity[j].is_nan() || velocity[j].abs() > RUNAWAY) {
            return Err(ScenarioError::Unstable {
                recording: self.name.clone(),
                joint: self.joints[j].name.clone(),
                time_s,
            });
        }
        self.step += 1;
        let now_s = self.time_s();
        for i in 0..self.pushes.len() {
            let push = &self.pushes[i];
            if time_s < push.peak_s() && push.peak_s() <= now_s {
                let event = Event {
                    on_s: push.on_s,
                    off_s: push.off_s,
                    kind: push.kind.clone(),
                    link: self.plant.link_name(push.link).to_owned(),
                    point_m: self.plant.world_point(push.link, push.point_m),
                    force_n: push.force_n,
                };
                self.events.push(event);
            }
        }
        Ok(())
    }
}

fn whole_steps(duration_s: f64) -> i64 {
    (duration_s * 1e9 / STEP_NS as f64).round() as i64
}

/// What the joints can do, with sensible ranges where the URDF gives none.
fn joint_ranges(model: &Model) -> Result<Vec<JointRange>, ScenarioError> {
    if model.dof() > MAX_JOINTS {
        return Err(ScenarioError::TooManyJoints {
            found: model.dof(),
            limit: MAX_JOINTS,
        });
    }
    let ranges = model.joints().iter().map(|joint| {
        let limits = &joint.limits;
        JointRange {
            name: joint.name.clone(),
            lower: limits.lower.unwrap_or(-FREE_RANGE),
            upper: limits.upper.unwrap_or(FREE_RANGE),
            velocity: limits.velocity.unwrap_or(FREE_VELOCITY),
            effort: limits.effort.unwrap_or(f64::INFINITY),
        }
    });
    Ok(ranges.collect())
}

fn with_tool(scenario: &Scenario, model: &Model) -> Result<Model, ScenarioError> {
    let mut model = model.clone();
    if let Some(tool) = &scenario.tool {
        let link = find_link(&model, "the tool", &tool.link)?;
        let inertia = Inertia::new(tool.mass_kg, tool.com_m, tool.inertia_kgm2);
        model.set_tool(link, inertia);
    }
    Ok(model)
}

fn trajectory(
    spec: &RecordingSpec,
    model: &Model,
    joints: &[JointRange],
    rng: ChaCha8Rng,
) -> Result<Trajectory, ScenarioError> {
    let motion = &spec.motion;
    match (&motion.points, &motion.fourier, &motion.recorded) {
        (Some(points), None, None) => {
            let allowed = above(model.clone(), points.min_height_m);
            let points = Points::new(points, joints, allowed, rng)?;
            Ok(Trajectory::Points(Box::new(points)))
        }
        (None, Some(fourier), None) => Ok(Trajectory::Fourier(Fourier::new(
            fourier,
            joints,
            spec.duration_s,
            rng,
        )?)),
        (None, None, Some(recorded)) => Ok(Trajectory::Spline(read_motion(recorded, joints)?)),
        (points, fourier, recorded) => Err(ScenarioError::OneMotion {
            recording: spec.name.clone(),
            found: usize::from(points.is_some())
                + usize::from(fourier.is_some())
                + usize::from(recorded.is_some()),
        }),
    }
}

/// Says of a position whether every moving link's frame is high enough.
fn above(model: Model, min_height_m: Option<f64>) -> Allowed {
    let Some(least_m) = min_height_m else {
        return Box::new(|_| true);
    };
    let mut data = Data::new(&model);
    Box::new(move |position| {
        forward_kinematics(&model, &mut data, position);
        model
            .joints()
            .iter()
            .all(|joint| link_pose(&model, &data, joint.child_link).translation.z >= least_m)
    })
}

/// The positions of a recording, seconds from its first.
fn read_motion(
    recorded: &RecordedMotionSpec,
    joints: &[JointRange],
) -> Result<Spline, ScenarioError> {
    let file = FileConfig {
        path: recorded.path.clone(),
        topics: Topics {
            state: recorded.topic.clone(),
            ..Topics::default()
        },
    };
    let setup = Setup {
        joint_names: joints.iter().map(|joint| joint.name.clone()).collect(),
        ..Setup::default()
    };
    let mut source = RecordedSource::open_file(&file, &Config::default(), &setup)
        .map_err(|error| ScenarioError::Motion(Box::new(error)))?;
    let (mut times_s, mut positions) = (Vec::new(), Vec::new());
    let mut first_ns = None;
    while let Some(sample) = source
        .next_packed()
        .map_err(|error| ScenarioError::Motion(Box::new(error)))?
    {
        let first_ns = *first_ns.get_or_insert(sample.header.stamp_ns);
        let time_s = (sample.header.stamp_ns - first_ns) as f64 * 1e-9;
        if times_s.last().is_none_or(|last| *last < time_s) {
            times_s.push(time_s);
            positions.push(sample.position);
        }
    }
    Ok(Spline::new(times_s, positions, joints.len()))
}
