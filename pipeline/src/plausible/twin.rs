//! Plausibility of a twin's samples: efforts with the wrong sign or unit, missing efforts, and a low-pass without
//! effect.

use tauscope_archive::{ArchiveError, Recording};
use tauscope_bus::{TwinState, flags};
use tauscope_dynamics::effort_scale::{self, EffortScale, ScaleFault};
use tauscope_twin::{Calibration, Filters, TwinFile, telling_slopes};

use super::PAUSE_NS;
use crate::cell::{Cell, EffortUnit};

/// Smallest number of samples with motion for which the slopes are judged.
/// Resolution: ten seconds at 100 Hz.
const TELLING_SAMPLES: u64 = 1000;
/// Smallest explained fraction of the measured effort for which its sign is judged; a push may exceed gravity.
/// Physical: above the correlation between model and friction.
const TELLING: f64 = 0.7;
/// Velocity above which a joint is moving \[rad/s, m/s\].
/// Physical: above the velocity noise of encoders.
const MOVES: f64 = 0.03;

/// Duration without efforts after which they are reported as ceased \[ns\].
/// Physical: longer than a driver takes to switch a controller.
const CEASED_NS: i64 = 3_000_000_000;

/// Interval without measured efforts, after the first ones.
#[derive(Debug, Clone, Copy, Default)]
struct Without {
    /// Stamp of the newest measured effort \[ns\].
    since_ns: Option<i64>,
    /// Duration without efforts so far \[ns\].
    lasts_ns: i64,
    /// The longest such interval, as (start, duration) \[ns\].
    longest: (i64, i64),
}

impl Without {
    /// Adds a sample; returns whether efforts have just ceased.
    fn add(&mut self, sample: &TwinState) -> bool {
        let stamp_ns = sample.header.stamp_ns;
        if sample.header.has(flags::EFFORT_MEASURED) {
            self.since_ns = Some(stamp_ns);
            self.lasts_ns = 0;
            return false;
        }
        let Some(since_ns) = self.since_ns else {
            return false;
        };
        let before_ns = std::mem::replace(&mut self.lasts_ns, stamp_ns - since_ns);
        if self.lasts_ns > self.longest.1 {
            self.longest = (since_ns, self.lasts_ns);
        }
        before_ns < CEASED_NS && self.lasts_ns >= CEASED_NS
    }
}

/// Plausibility check of the samples of a twin.
#[derive(Debug)]
pub struct PlausibleTwin {
    names: Vec<String>,
    calibration: Calibration,
    /// Whether measured and expected effort have the same unit.
    is_alike: bool,
    filters: Filters,
    first_ns: Option<i64>,
    last_ns: Option<i64>,
    without_effort: Without,
    /// Number of sample periods without pauses, and their total duration \[ns\].
    steps: u64,
    steps_ns: i64,
}

impl PlausibleTwin {
    /// Creates the check of a twin with this configuration and correction.
    pub fn new(config: &tauscope_twin::Config, model: Option<&TwinFile>, cell: &Cell) -> Self {
        let facts = &cell.facts;
        let in_nm =
            facts.effort_unit == EffortUnit::Nm || facts.torque_constants_nm_per_a.is_some();
        Self {
            names: facts.joint_names.clone(),
            calibration: Calibration::new(facts.joint_names.len(), false),
            is_alike: in_nm || model.is_some(),
            filters: config.filters(model.map(|model| model.filters)),
            first_ns: None,
            last_ns: None,
            without_effort: Without::default(),
            steps: 0,
            steps_ns: 0,
        }
    }

    /// Adds a sample; returns whether the efforts have just ceased, which is reported at once.
    pub fn add(&mut self, sample: &TwinState) -> bool {
        let stamp_ns = sample.header.stamp_ns;
        self.first_ns.get_or_insert(stamp_ns);
        let have_ceased = self.without_effort.add(sample);
        if let Some(last_ns) = self.last_ns.replace(stamp_ns) {
            let step_ns = stamp_ns - last_ns;
            if (1..PAUSE_NS).contains(&step_ns) {
                self.steps += 1;
                self.steps_ns += step_ns;
            }
        }
        // A pushed arm at rest deflects, so its effort does not reflect gravity alone.
        let velocities = &sample.velocity[..self.names.len()];
        if velocities.iter().any(|velocity| velocity.abs() > MOVES) {
            self.calibration.add(sample);
        }
        have_ceased
    }

    /// Samples per second.
    pub fn rate_hz(&self) -> Option<f64> {
        (self.steps > 0).then(|| self.steps as f64 / (self.steps_ns as f64 * 1e-9))
    }

    /// Irregularities so far.
    pub fn oddities(&self) -> Vec<String> {
        let rate_hz = self.rate_hz().into_iter();
        let cutoffs = rate_hz.flat_map(|rate_hz| cutoffs_above_half(self.filters, rate_hz));
        let scale = self.scale_fault().map(|fault| match fault {
            ScaleFault::Turned { joints, .. } => format!(
                "the effort of {} has the other sign than the twin's: turn its sign in the driver",
                joints.join(", ")
            ),
            ScaleFault::WrongUnit { slope } | ScaleFault::NoCurrent { slope } => format!(
                "the measured effort is {slope:.3} times the twin's expected effort: its unit differs from the twin's"
            ),
        });
        cutoffs.chain(scale).chain(self.ceased()).collect()
    }

    /// Message about the longest interval without efforts.
    fn ceased(&self) -> Option<String> {
        let (since_ns, lasts_ns) = self.without_effort.longest;
        let at_s = (since_ns - self.first_ns?) as f64 * 1e-9;
        (lasts_ns >= CEASED_NS).then(|| {
            format!(
                "no effort is measured from {at_s:.1} s on, for {:.1} s or more: the driver publishes none or plain \
                 zeros, or the drives are off; meanwhile no contact can be found",
                lasts_ns as f64 * 1e-9
            )
        })
    }

    fn scale_fault(&self) -> Option<ScaleFault> {
        if self.calibration.samples() < TELLING_SAMPLES {
            return None;
        }
        let mut fits = self.calibration.fit()?;
        for fit in &mut fits {
            if fit.explained < TELLING {
                fit.explained = effort_scale::TELLING / 2.0;
            }
        }
        let scale = EffortScale::of(&telling_slopes(&self.names, &fits));
        let fault = scale.fault_in_nm()?;
        let tells = self.is_alike || matches!(fault, ScaleFault::Turned { .. });
        tells.then_some(fault)
    }
}

/// Message and remedy for a low-pass called `name` that has no effect at this rate.
pub fn cutoff_above_half(name: &str, cutoff_hz: f64, rate_hz: f64) -> Option<(String, String)> {
    (cutoff_hz > rate_hz / 2.0).then(|| {
        let title = format!(
            "{rate_hz:.1} joint states a second, so {name} {cutoff_hz} would pass everything"
        );
        let help = format!("give less than {:.1}, half the rate", rate_hz / 2.0);
        (title, help)
    })
}

/// Messages about a twin's low-passes without effect at this rate.
pub fn cutoffs_above_half(filters: Filters, rate_hz: f64) -> impl Iterator<Item = String> {
    let all = [
        ("`velocity_cutoff_hz`", filters.velocity_cutoff_hz),
        ("`effort_cutoff_hz`", filters.effort_cutoff_hz),
    ];
    all.into_iter().filter_map(move |(name, cutoff_hz)| {
        let (title, help) = cutoff_above_half(name, cutoff_hz, rate_hz)?;
        Some(format!("{title}; {help}"))
    })
}

/// Rate of joint states on the topic `state` of a recording \[Hz\], from its index.
///
/// # Errors
/// If there is no such topic.
pub fn recorded_rate_hz(recording: &Recording, state: &str) -> Result<Option<f64>, ArchiveError> {
    let count = recording.joint_state_topic(state)?.message_count as f64;
    let span_ns = recording.end_ns().zip(recording.start_ns());
    let span_ns = span_ns.map_or(0, |(end, start)| end - start);
    Ok((span_ns > 0).then(|| count / (span_ns as f64 * 1e-9)))
}
