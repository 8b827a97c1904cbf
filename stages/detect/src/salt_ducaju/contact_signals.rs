//! Input signals of the detectors after Salt Ducaju et al.: external force, its frequency content, and the tool's
//! velocity.

use std::ops::RangeInclusive;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_bus::{TwinState, flags};
use tauscope_dynamics::lowpass::Butterworth2;

use crate::frame::momentum::{DEFAULT_GAIN_PER_S, MomentumObserver};
use crate::frame::{ConfigError, Impedance, Setup, Tap, rate};
use crate::salt_ducaju::sliding_dft::{BandError, SlidingDft, bins};
use crate::salt_ducaju::wrench::ToolPoint;

/// Estimation and filtering of the external force, common to the detectors after Salt Ducaju et al.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SignalSettings {
    /// Gain of the momentum observer \[1/s\].
    #[schemars(range(min = 0.1, max = 100_000.0))]
    pub observer_gain_per_s: f64,
    /// Number of samples in the sliding window (N).
    #[schemars(range(min = 2, max = 1_000_000))]
    pub window: usize,
    /// Monitored frequency band \[Hz\]: at least 1/(N h) and at most 1/(2 h), where h is the sample period according
    /// to the stamps.
    pub band_hz: [f64; 2],
    /// Low-pass on the tool's velocity \[Hz\].
    #[schemars(range(min = 0.01, max = 10_000.0))]
    pub velocity_cutoff_hz: f64,
    /// Sample rate of the recordings on which the thresholds were tuned \[Hz\]; they are valid for no other rate.
    #[schemars(range(min = 0.01, max = 1_000_000.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tuned_rate_hz: Option<f64>,
    /// Impedance of the cell in which the thresholds were tuned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tuned_impedance: Option<Impedance>,
}

impl Default for SignalSettings {
    fn default() -> Self {
        Self {
            observer_gain_per_s: DEFAULT_GAIN_PER_S,
            window: 500,
            band_hz: [10.0, 100.0],
            velocity_cutoff_hz: 20.0,
            tuned_rate_hz: None,
            tuned_impedance: None,
        }
    }
}

impl SignalSettings {
    /// Returns a warning if the cell's impedance differs from the one at which `detector` was tuned; thresholds then
    /// "must be varied" (Salt Ducaju et al.).
    pub(crate) fn warning(&self, detector: &str, setup: &Setup) -> Option<String> {
        let (tuned, now) = (self.tuned_impedance?, setup.impedance?);
        (tuned != now).then(|| {
            format!(
                "{detector} was tuned at {} N/m and {} N m/rad, and the cell's impedance is {} N/m and {} N m/rad: forces rise otherwise there; tune it again",
                tuned.translational_n_per_m,
                tuned.rotational_nm_per_rad,
                now.translational_n_per_m,
                now.rotational_nm_per_rad
            )
        })
    }
}

/// The signals at one instant, in the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// Stamp of the sample \[ns since the epoch\].
    pub stamp_ns: i64,
    /// External force on the robot at the tool \[N\].
    pub force_n: [f64; 3],
    /// L∞-norm of the force's spectrum over the band, by direction \[N\].
    pub norms_n: [f64; 3],
    /// Low-passed velocity of the tool \[m/s\].
    pub velocity_m_per_s: [f64; 3],
    /// The point on the tool to which force and velocity refer \[m\].
    pub point_m: [f64; 3],
}

impl Instant {
    /// Returns the largest of the norms \[N\].
    pub fn largest_norm_n(&self) -> f64 {
        self.norms_n.into_iter().fold(0.0, f64::max)
    }
}

/// Computes instants from a twin's samples. No allocation per sample.
#[derive(Debug, Clone)]
pub struct Signals {
    settings: SignalSettings,
    observer: MomentumObserver,
    tool: ToolPoint,
    velocity: [Butterworth2; 3],
    dft: SlidingDft,
    /// Stamps and forces until the window is full for the first time since the start or a gap.
    filling: Vec<(i64, [f64; 3])>,
    periods_ns: Vec<i64>,
    full: bool,
    before_ns: Option<i64>,
    newest: Option<Instant>,
    fault: Option<BandError>,
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
        let observer = MomentumObserver::new(setup, settings.observer_gain_per_s, detector)?;
        let Some(model) = &setup.model else {
            return Err(ConfigError::NoModel { detector });
        };
        let velocity = Butterworth2::new(settings.velocity_cutoff_hz);
        // The sample period needs two samples.
        let settings = SignalSettings {
            window: settings.window.max(2),
            ..*settings
        };
        Ok(Self {
            settings,
            observer,
            tool: ToolPoint::new(model, setup.tool_link, setup.contact_point_on_tool_m),
            velocity: std::array::from_fn(|_| velocity.clone()),
            dft: SlidingDft::new(settings.window),
            filling: Vec::with_capacity(settings.window),
            periods_ns: Vec::with_capacity(settings.window),
            full: false,
            before_ns: None,
            newest: None,
            fault: None,
        })
    }

    /// [`Signals::new`], shared with other detectors through [`Setup::shared`].
    pub(crate) fn tap(
        settings: &SignalSettings,
        setup: &Setup,
        detector: &'static str,
    ) -> Result<Tap<Self>, ConfigError> {
        let own = Self::new(settings, setup, detector)?;
        Ok(match &setup.shared {
            Some(shared) => shared.tap(*settings, || own),
            None => Tap::own(own),
        })
    }

    /// Returns the link of the point on the tool.
    pub fn tool_link(&self) -> usize {
        self.tool.link()
    }

    /// Returns the reason why the band cannot be monitored at this stream's rate, once that is known.
    pub fn fault(&self) -> Option<BandError> {
        self.fault
    }

    /// Processes the next sample. Returns the instant once the window is full of samples with [`flags::READY`]. A
    /// repeated stamp returns the same instant again.
    pub fn update(&mut self, sample: &TwinState) -> Option<Instant> {
        let stamp_ns = sample.header.stamp_ns;
        let before_ns = self.before_ns.filter(|_| !sample.header.has(flags::RESET));
        if before_ns.is_some_and(|before| stamp_ns <= before) {
            return self.newest;
        }
        self.observer.update(sample);
        let at = self.tool.at(&mut self.observer, &sample.velocity);
        let mut velocity_m_per_s = [0.0; 3];
        for (axis, filter) in self.velocity.iter_mut().enumerate() {
            let value = at.velocity_m_per_s[axis];
            if before_ns.is_none() {
                filter.reset(value);
            }
            let dt_s = before_ns.map_or(0.0, |before| (stamp_ns - before) as f64 * 1e-9);
            velocity_m_per_s[axis] = filter.update(dt_s, value);
        }
        self.before_ns = Some(stamp_ns);
        if before_ns.is_none() || !sample.header.has(flags::READY) {
            self.empty();
        }
        let force_n = at.force_n.into();
        let settled = sample.header.has(flags::READY) && self.observer.settled();
        self.newest =
            (settled && self.fault.is_none() && self.watch(stamp_ns, force_n)).then(|| Instant {
                stamp_ns,
                force_n,
                norms_n: self.dft.norms(),
                velocity_m_per_s,
                point_m: at.position_m.into(),
            });
        self.newest
    }

    fn empty(&mut self) {
        self.filling.clear();
        self.full = false;
    }

    /// Adds a force to the window; true once the window is full.
    fn watch(&mut self, stamp_ns: i64, force_n: [f64; 3]) -> bool {
        if self.full {
            self.dft.push(force_n);
            return true;
        }
        self.filling.push((stamp_ns, force_n));
        if self.filling.len() < self.settings.window {
            return false;
        }
        match self.bins() {
            Ok(bins) => {
                self.dft.set_bins(bins);
                for &(_, force_n) in &self.filling {
                    self.dft.push(force_n);
                }
                self.full = true;
            }
            Err(fault) => self.fault = Some(fault),
        }
        self.full
    }

    /// Returns the bins of the band; an error if the rate differs from that of the tuning. The sample period is the
    /// median over the window, so that neither jitter nor a missing sample changes it.
    fn bins(&mut self) -> Result<RangeInclusive<usize>, BandError> {
        let stamps = self.filling.windows(2);
        self.periods_ns.clear();
        self.periods_ns
            .extend(stamps.map(|pair| pair[1].0 - pair[0].0));
        let middle = self.periods_ns.len() / 2;
        let (_, &mut period_ns, _) = self.periods_ns.select_nth_unstable(middle);
        let period_s = period_ns as f64 * 1e-9;
        let bins = bins(self.settings.window, period_s, self.settings.band_hz)?;
        match self.settings.tuned_rate_hz {
            Some(tuned_hz) if !rate::same(tuned_hz, 1.0 / period_s) => Err(BandError::OtherRate {
                tuned_hz,
                rate_hz: 1.0 / period_s,
            }),
            _ => Ok(bins),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_impedance_than_the_tuned_one_is_told() {
        let impedance = |translational_n_per_m| {
            Some(Impedance {
                translational_n_per_m,
                rotational_nm_per_rad: 10.0,
            })
        };
        let settings = SignalSettings {
            tuned_impedance: impedance(150.0),
            ..SignalSettings::default()
        };
        let at = |impedance| Setup {
            impedance,
            ..Setup::default()
        };
        assert_eq!(settings.warning("x", &at(impedance(150.0))), None);
        assert_eq!(settings.warning("x", &at(None)), None);
        let text = settings.warning("x", &at(impedance(300.0))).unwrap();
        assert!(
            text.contains("tuned at 150 N/m") && text.contains("300 N/m"),
            "{text}"
        );
    }
}
