//! Input signals of the learned methods: positions, velocities and external torques, all filtered by
//! the same low-pass (section IV-B: "for all methods, low-pass filtered data were input").

use tauscope_bus::{JointArray, TwinState, flags};
use tauscope_dynamics::lowpass::Butterworth2;

use crate::frame::momentum::MomentumObserver;
use crate::frame::{ConfigError, Lesson, Setup, SignalSettings};

/// Low-passed state of the arm at one instant; entries beyond the joints are zero.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Signal {
    /// Time of the sample \[ns\].
    pub stamp_ns: i64,
    /// External torque that the momentum observer estimates \[N m\].
    pub torque: JointArray,
    /// Position \[rad\].
    pub position: JointArray,
    /// Velocity \[rad/s\].
    pub velocity: JointArray,
    /// Velocity at the previous sample \[rad/s\].
    pub previous_velocity: JointArray,
}

/// Computes [`Signal`]s from a twin's samples. No allocation per sample.
pub(crate) struct Signals {
    observer: MomentumObserver,
    /// Low-passes of torque, position and velocity, by joint.
    filters: Vec<[Butterworth2; 3]>,
    settling_time_s: f64,
    started_ns: i64,
    previous_ns: Option<i64>,
    signal: Signal,
}

impl Signals {
    /// Creates the signals of the robot of `setup`; `detector` is named in errors.
    ///
    /// # Errors
    /// If `setup` has no model.
    pub fn new(
        settings: &SignalSettings,
        setup: &Setup,
        detector: &'static str,
    ) -> Result<Self, ConfigError> {
        let filter = Butterworth2::new(settings.cutoff_hz);
        let observer = MomentumObserver::new(setup, settings.observer_gain_per_s, detector)?;
        let joint_count = setup.joints.len();
        Ok(Self {
            observer,
            settling_time_s: filter.settling_time_s(),
            filters: vec![[filter.clone(), filter.clone(), filter]; joint_count],
            started_ns: 0,
            previous_ns: None,
            signal: Signal::default(),
        })
    }

    /// Processes the next sample. Returns the signal once the twin, the observer and the low-passes have settled.
    /// [`flags::RESET`] restarts the settling.
    pub fn update(&mut self, sample: &TwinState) -> Option<&Signal> {
        let stamp_ns = sample.header.stamp_ns;
        let torque = *self.observer.update(sample);
        let before = self
            .previous_ns
            .filter(|_| !sample.header.has(flags::RESET));
        let dt_s = before.map(|before| (stamp_ns - before) as f64 * 1e-9);
        if dt_s.is_none() {
            self.started_ns = stamp_ns;
        }
        self.signal.stamp_ns = stamp_ns;
        self.signal.previous_velocity = self.signal.velocity;
        for (j, filters) in self.filters.iter_mut().enumerate() {
            let inputs = [torque[j], sample.position[j], sample.velocity[j]];
            let mut outputs = [0.0; 3];
            for ((filter, input), output) in filters.iter_mut().zip(inputs).zip(&mut outputs) {
                if dt_s.is_none() {
                    filter.reset(input);
                }
                *output = filter.update(dt_s.unwrap_or(0.0), input);
            }
            [
                self.signal.torque[j],
                self.signal.position[j],
                self.signal.velocity[j],
            ] = outputs;
        }
        self.previous_ns = Some(stamp_ns);
        let settled = sample.header.has(flags::READY)
            && self.observer.settled()
            && (stamp_ns - self.started_ns) as f64 * 1e-9 >= self.settling_time_s;
        settled.then_some(&self.signal)
    }

    /// Returns the contact-free segments of recordings, each without a gap.
    pub fn stretches(&mut self, lessons: &[Lesson]) -> Vec<Vec<Signal>> {
        let mut stretches = Vec::new();
        for lesson in lessons {
            let mut stretch = Vec::new();
            for sample in lesson.anew() {
                let touched = lesson.touches(sample.header.stamp_ns);
                match self.update(&sample).filter(|_| !touched) {
                    Some(signal) => stretch.push(*signal),
                    None => stretches.push(std::mem::take(&mut stretch)),
                }
            }
            stretches.push(stretch);
        }
        stretches.retain(|stretch| !stretch.is_empty());
        stretches
    }
}
