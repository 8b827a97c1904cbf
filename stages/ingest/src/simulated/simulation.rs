//! Simulation of one recording of a cell, instant by instant.

use tauscope_bus::JointArray;
use tauscope_dynamics::Model;

use super::conceal;
use super::controller::Controller;
use super::error::ScenarioError;
use super::obstacle::{Obstacle, obstacles};
use super::plan::{self, STEP_NS, offset_ns, whole_steps};
use super::plant::{Contact, Plant};
use super::push::{Push, pushes};
use super::record::Record;
use super::scenario::{ContactKind, LabelSpec, Scenario};
use super::sensors::SensorBank;
use super::trajectory::{JointRange, Target, Trajectory};

/// Number of plant steps per control step, for a controller at 1 kHz.
/// Physical: 1 kHz is the usual rate of a torque-controlled arm, e.g. Franka's control interface.
const STEPS_PER_CONTROL: i64 = 4;
/// Velocity above which the arm is treated as unstable \[rad/s or m/s\].
/// Physical: about 30 times the highest joint speed of common arms.
const RUNAWAY: f64 = 100.0;

/// Values that the cell publishes at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Stamp \[ns since the epoch\].
    pub stamp_ns: i64,
    /// Measured position \[rad\].
    pub position: JointArray,
    /// Measured velocity \[rad/s\].
    pub velocity: JointArray,
    /// Measured effort in the scenario's unit.
    pub effort: JointArray,
    /// Commanded position \[rad\].
    pub command_position: JointArray,
    /// Whether something touches the arm.
    pub contact: bool,
    /// Whether learning was requested since the previous reading.
    pub learn: bool,
}

/// A contact as described in the labels.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Begin \[s from the first reading\].
    pub on_s: f64,
    /// End \[s from the first reading\].
    pub off_s: f64,
    /// Kind of contact.
    pub kind: ContactKind,
    /// The link that is touched.
    pub link: String,
    /// Point of contact at its peak, world frame \[m\].
    pub point_m: [f64; 3],
    /// Force on the robot at its peak, world frame \[N\].
    pub force_n: [f64; 3],
    /// The joints between the base and the link, each with the torque of the peak force, `Jᵀ F` \[N m\].
    pub joints: Vec<(String, f64)>,
    /// Further labels.
    pub label: LabelSpec,
}

impl Event {
    /// Returns the magnitude of its peak force \[N\].
    pub fn peak_n(&self) -> f64 {
        self.force_n.iter().map(|f| f * f).sum::<f64>().sqrt()
    }
}

/// The simulation of one recording.
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
    record: Record,
    sensors: SensorBank,
    pushes: Vec<Push>,
    obstacles: Vec<Obstacle>,
    /// The force of each obstacle in this step.
    touches: Vec<Option<Contact>>,
    events: Vec<Event>,
    /// Times at which learning is requested \[s\], ascending.
    learn_at_s: std::iter::Peekable<std::vec::IntoIter<f64>>,
}

impl Simulation {
    /// Creates the simulation of the scenario's recording `index`; `model` is the robot that the scenario names.
    ///
    /// # Errors
    /// If the scenario does not fit the robot, or cannot be simulated.
    pub fn new(scenario: &Scenario, model: &Model, index: usize) -> Result<Self, ScenarioError> {
        let (scenario, _) = conceal::add(scenario, model)?;
        let spec = &scenario.recordings[index];
        let joints = plan::joint_ranges(model)?;
        let rng = |stream| plan::random(&scenario, index, stream);
        let model = plan::with_tool(&scenario, model)?;
        let mut trajectory = plan::trajectory(spec, &model, &joints, rng(0))?;
        let target = trajectory.at(0.0);
        let start = &target.position[..joints.len()];
        let pushes = pushes(spec, &model, rng(1))?;
        let offset_ns = offset_ns(&scenario, index);
        let mut plant = Plant::new(&model, &scenario.physics, start)?;
        let obstacles = obstacles(spec, &model)?;
        for obstacle in &obstacles {
            obstacle.check_start(&mut plant)?;
        }
        let controller = Controller::new(&model, &scenario.controller, &joints, start)?;
        let record = Record::new(&model, &scenario.physics)?;
        let mut learn_at_s = spec.learn_at_s.clone();
        learn_at_s.sort_by(f64::total_cmp);
        Ok(Self {
            learn_at_s: learn_at_s.into_iter().peekable(),
            name: spec.name.clone(),
            start_ns: i64::from(scenario.start_s) * 1_000_000_000 + offset_ns,
            step: 0,
            last_step: whole_steps(spec.duration_s),
            next_sample: 0,
            rate_hz: scenario.rate_hz,
            controller,
            plant: plant.starting_at(offset_ns as f64 * 1e-9),
            record,
            sensors: SensorBank::new(&scenario, &joints, rng(2))?,
            trajectory,
            target,
            events: Vec::with_capacity(pushes.len()),
            pushes,
            touches: vec![None; obstacles.len()],
            obstacles,
            joints,
        })
    }

    /// Simulates up to the next published instant; returns `None` at the end.
    ///
    /// # Errors
    /// [`ScenarioError::Unstable`] if the arm runs away.
    pub fn next_reading(&mut self) -> Result<Option<Reading>, ScenarioError> {
        while self.step <= self.last_step {
            let time_s = self.time_s();
            if self.step % STEPS_PER_CONTROL == 0 {
                self.target = self.trajectory.at(time_s);
                let dt_s = (STEPS_PER_CONTROL * STEP_NS) as f64 * 1e-9;
                let (position, velocity) = (self.plant.position(), self.plant.velocity());
                self.controller
                    .update(dt_s, &self.target, position, velocity);
            }
            let due = (self.step >= self.next_sample).then(|| self.read(time_s));
            self.advance(time_s)?;
            if let Some(mut reading) = due {
                // The effort at this instant is the one that drives the step from here.
                let efforts_nm = self.record.effort_nm();
                reading.effort = self.sensors.measure_effort(efforts_nm);
                return Ok(Some(reading));
            }
        }
        self.events
            .extend(self.obstacles.iter_mut().filter_map(Obstacle::rest));
        Ok(None)
    }

    /// Returns the pushes that have passed their peak so far, and the contacts with obstacles that have ended; at
    /// the end also the contacts in progress.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Returns the length of a cycle of the motion \[s\], if it repeats itself exactly.
    pub fn cycle_s(&self) -> Option<f64> {
        self.trajectory.cycle_s()
    }

    /// Returns the completed fraction of the recording, 0 to 1.
    pub fn fraction_done(&self) -> f64 {
        (self.step as f64 / self.last_step as f64).min(1.0)
    }

    fn time_s(&self) -> f64 {
        (self.step * STEP_NS) as f64 * 1e-9
    }

    /// Measures everything but the effort.
    fn read(&mut self, time_s: f64) -> Reading {
        // The instants of the rate, each moved to the next step of the plant.
        let index = (time_s * self.rate_hz + 1e-6).floor() + 1.0;
        self.next_sample = (index / self.rate_hz * 1e9 / STEP_NS as f64 - 1e-6).ceil() as i64;
        let (position, velocity) = self
            .sensors
            .measure_motion(self.plant.position(), self.plant.velocity());
        let mut learn = false;
        while self.learn_at_s.next_if(|at_s| *at_s <= time_s).is_some() {
            learn = true;
        }
        Reading {
            learn,
            stamp_ns: self.start_ns + self.step * STEP_NS,
            position,
            velocity,
            effort: JointArray::default(),
            command_position: self.sensors.in_steps(&self.target.position),
            contact: self.pushes.iter().any(|push| push.acts(time_s))
                || self.obstacles.iter().any(Obstacle::touching),
        }
    }

    /// Advances the plant by one step.
    fn advance(&mut self, time_s: f64) -> Result<(), ScenarioError> {
        let n = self.joints.len();
        for (touch, obstacle) in self.touches.iter_mut().zip(&self.obstacles) {
            *touch = obstacle.contact(time_s, &mut self.plant);
        }
        let pushes = self.pushes.iter().filter(|push| push.acts(time_s));
        let contacts = pushes
            .map(|push| push.contact(push.share(time_s)))
            .chain(self.touches.iter().flatten().copied());
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
        self.record.take(&self.plant, self.plant.applied_nm(), dt_s);
        self.step += 1;
        let now_s = self.time_s();
        for push in &self.pushes {
            if time_s < push.peak_s() && push.peak_s() <= now_s {
                let (times_s, peak) = ([push.on_s, push.off_s], push.contact(1.0));
                let event = self.plant.event_of(&peak, times_s, push.kind, &push.label);
                self.events.push(event);
            }
        }
        for (touch, obstacle) in self.touches.iter().zip(&mut self.obstacles) {
            let ended = obstacle.note(time_s, now_s, touch.as_ref(), &mut self.plant);
            self.events.extend(ended);
        }
        Ok(())
    }
}
