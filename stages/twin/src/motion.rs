//! The motion whose effort the twin computes.

use tauscope_bus::{JointArray, JointState, MAX_JOINTS, flags};
use tauscope_dynamics::derivative::FilteredDerivative;

use crate::config::Motion;

/// Tracks the selected motion and differentiates its velocity.
#[derive(Debug)]
pub(crate) struct MotionTracker {
    motion: Motion,
    acceleration_filters: Vec<FilteredDerivative>,
    /// Velocity of the previous sample, for the trapezoidal rule.
    previous_velocity: JointArray,
    pub position: JointArray,
    pub velocity: JointArray,
    pub acceleration: JointArray,
}

impl MotionTracker {
    pub fn new(motion: Motion, joint_count: usize, velocity_cutoff_hz: f64) -> Self {
        Self {
            motion,
            acceleration_filters: vec![FilteredDerivative::new(velocity_cutoff_hz); joint_count],
            previous_velocity: [0.0; MAX_JOINTS],
            position: [0.0; MAX_JOINTS],
            velocity: [0.0; MAX_JOINTS],
            acceleration: [0.0; MAX_JOINTS],
        }
    }

    /// Returns the time from a reset until the acceleration is valid \[s\].
    pub fn settling_time_s(&self) -> f64 {
        self.acceleration_filters
            .first()
            .map_or(0.0, FilteredDerivative::settling_time_s)
    }

    /// Returns whether the sample contains the tracked motion.
    pub fn knows(&self, sample: &JointState) -> bool {
        self.motion != Motion::Commanded || sample.header.has(flags::COMMAND)
    }

    /// Restarts at this sample with zero acceleration.
    pub fn reset(&mut self, sample: &JointState) {
        let (position, velocity) = self.source(sample);
        self.position = *position;
        self.velocity = *velocity;
        self.previous_velocity = *velocity;
        self.acceleration = [0.0; MAX_JOINTS];
        for (filter, &v) in self.acceleration_filters.iter_mut().zip(velocity) {
            filter.reset(v);
        }
    }

    /// Advances by `dt_s`; a repeated stamp (0) leaves the acceleration unchanged.
    pub fn update(&mut self, dt_s: f64, sample: &JointState) {
        let (position, velocity) = self.source(sample);
        let (position, velocity) = (*position, *velocity);
        if self.motion == Motion::VelocityHistory {
            let velocities = self.previous_velocity.iter().zip(&velocity);
            for (position, (before, now)) in self.position.iter_mut().zip(velocities) {
                *position += 0.5 * (before + now) * dt_s;
            }
        } else {
            self.position = position;
        }
        self.previous_velocity = velocity;
        self.velocity = velocity;
        for (j, filter) in self.acceleration_filters.iter_mut().enumerate() {
            self.acceleration[j] = filter.update(dt_s, velocity[j]);
        }
    }

    fn source<'a>(&self, sample: &'a JointState) -> (&'a JointArray, &'a JointArray) {
        match self.motion {
            Motion::Measured | Motion::VelocityHistory => (&sample.position, &sample.velocity),
            Motion::Commanded => (&sample.command_position, &sample.command_velocity),
        }
    }
}
