//! The series: what was estimated, night by night.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::robust::median;

/// Nights that are learned before anything is told. Resolution: two weeks have every day's work twice.
pub const LEARNED: usize = 14;
/// Half width of a 95 % interval of a normal variable, in standard deviations.
/// Statistical: the 97.5 % quantile of the standard normal distribution.
const HALF_WIDTH_95: f64 = 1.96;
/// Hours in which an arm becomes warm.
/// Resolution: joints of arms take 0.5 to 2 hours; a covariate need only tell cold from warm.
const WARM_UP_H: f64 = 1.0;
/// A covariate is used if this share of the estimates has it.
/// Resolution: a sensor that fails on some nights does not end its use.
const MOST: f64 = 0.9;
/// Other joints from which on their median is used.
/// Resolution: one joint of three that wears does not move it.
const LEAST_JOINTS: usize = 3;

/// What is estimated of an arm each night.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Coulomb friction of a joint.
    Coulomb,
    /// Viscous friction of a joint.
    Viscous,
    /// Recorded effort of a joint's bodies over the modelled one.
    Gain,
    /// Constant part of a joint's effort that nothing explains.
    Offset,
    /// Play in a joint's gear.
    Backlash,
    /// Mass on the tool.
    Payload,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Coulomb,
        Self::Viscous,
        Self::Gain,
        Self::Offset,
        Self::Backlash,
        Self::Payload,
    ];

    /// The name of the number, with its unit, as terms and tables have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Coulomb => "coulomb_nm",
            Self::Viscous => "viscous_nms_per_rad",
            Self::Gain => "gain",
            Self::Offset => "bias_nm",
            Self::Backlash => "gap_rad",
            Self::Payload => "mass_kg",
        }
    }

    /// The quantity of that name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|one| one.name() == name)
    }

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Coulomb => "Coulomb friction",
            Self::Viscous => "viscous friction",
            Self::Gain => "gain",
            Self::Offset => "offset",
            Self::Backlash => "play of the gear",
            Self::Payload => "mass on the tool",
        }
    }

    /// Its unit. `effort` is that of efforts: `N m` or `A`.
    pub fn unit(self, effort: &str) -> String {
        match self {
            Self::Coulomb | Self::Offset => effort.to_owned(),
            Self::Viscous => format!("{effort} s/rad"),
            Self::Gain => String::new(),
            Self::Backlash => "rad".to_owned(),
            Self::Payload => "kg".to_owned(),
        }
    }

    /// Whether it is friction.
    pub fn is_friction(self) -> bool {
        matches!(self, Self::Coulomb | Self::Viscous)
    }

    /// The smallest change that is told, at this level.
    /// Resolution: 5 % of friction is what 5 K change on many gears, and below it no mechanic finds anything; 50 g are less
    /// than any tool. An offset has no level of its own: what is certain is told.
    pub(crate) fn relevant(self, level: f64) -> f64 {
        match self {
            Self::Coulomb | Self::Viscous => 0.05 * level.abs(),
            Self::Gain => 0.01 * level.abs(),
            Self::Backlash => 0.2 * level.abs(),
            Self::Offset => 0.0,
            Self::Payload => 0.05,
        }
    }

    /// Standard deviation of the prior of the slope against temperature, as a share of the level \[1/K\].
    /// Physical: viscous friction of greased gears falls by up to 3 % a kelvin (Carvalho Bittencourt and Gunnarsson,
    /// "Static Friction in a Robot Joint", 2012, figure 7); the constants of magnets and copper by less than 0.4 %.
    pub(crate) fn slope_share(self) -> f64 {
        match self {
            Self::Coulomb | Self::Viscous => 0.03,
            Self::Gain => 0.004,
            Self::Offset | Self::Backlash | Self::Payload => 0.0,
        }
    }
}

/// What was estimated in one night.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// When \[days since 1970-01-01 UTC\].
    pub day: f64,
    /// The estimate.
    pub value: f64,
    /// Lower end of its 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Temperature of the joint then \[deg C\].
    pub temperature_c: Option<f64>,
    /// How long the robot had been running then \[h\].
    pub hours_since_start: Option<f64>,
}

impl Estimate {
    /// Standard deviation of its error.
    pub fn deviation(&self) -> f64 {
        (self.high - self.low) / (2.0 * HALF_WIDTH_95)
    }

    /// Whether it can be used.
    pub(crate) fn is_sound(&self) -> bool {
        self.day.is_finite() && self.value.is_finite() && {
            let deviation = self.deviation();
            deviation.is_finite() && deviation > 0.0
        }
    }
}

/// What warms a joint, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Covariate {
    /// Its temperature \[deg C\].
    Temperature,
    /// How cold it still is by the time since the start of the robot: exp(-t / 1 h).
    TimeSinceStart,
    /// The same quantity of the other joints, over what it was at first: all joints of an arm become warm together.
    OtherJoints,
}

impl Covariate {
    /// Its value at an estimate; `None` where the estimate alone does not tell it.
    pub fn of(self, estimate: &Estimate) -> Option<f64> {
        match self {
            Self::Temperature => estimate.temperature_c,
            Self::TimeSinceStart => estimate.hours_since_start.map(|h| (-h / WARM_UP_H).exp()),
            Self::OtherJoints => None,
        }
        .filter(|value| value.is_finite())
    }
}

/// One quantity of one joint, night by night.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// The joint; `None` for what belongs to the whole arm.
    pub joint: Option<String>,
    /// What was estimated.
    pub quantity: Quantity,
    /// The estimates, oldest first.
    pub estimates: Vec<Estimate>,
}

/// What a series goes with, estimate by estimate.
#[derive(Debug, Clone)]
pub struct Warmth {
    /// What it is.
    pub covariate: Covariate,
    /// Its value at each estimate of the series, where it is known.
    pub values: Vec<Option<f64>>,
}

impl Warmth {
    /// What a series goes with: temperature where it is known, else the time since the start, else, for friction, the
    /// other joints.
    pub fn of(series: &Series, all: &[Series]) -> Option<Self> {
        let known = |covariate: Covariate| {
            let values = series.estimates.iter().map(|one| covariate.of(one));
            Self {
                covariate,
                values: values.collect(),
            }
        };
        [Covariate::Temperature, Covariate::TimeSinceStart]
            .into_iter()
            .map(known)
            .chain(others(series, all))
            .find(Self::is_known)
    }

    /// Whether nearly all estimates have it, and it varies.
    fn is_known(&self) -> bool {
        let known: Vec<f64> = self.values.iter().flatten().copied().collect();
        let first = known.first().copied().unwrap_or(0.0);
        let varies = known.iter().any(|value| (value - first).abs() > 1e-6);
        varies && known.len() as f64 >= MOST * self.values.len() as f64
    }
}

/// The median of the other joints' friction, each over what it was in its first nights.
fn others(series: &Series, all: &[Series]) -> Option<Warmth> {
    if !series.quantity.is_friction() {
        return None;
    }
    // Estimates of one night have one stamp, to the minute.
    let minute = |one: &Estimate| (one.day * 1440.0).round() as i64;
    let mut by_minute: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    let is_other = |other: &&Series| {
        other.quantity == series.quantity && other.joint.is_some() && other.joint != series.joint
    };
    for other in all.iter().filter(is_other) {
        let first = other.estimates.iter().take(LEARNED).map(|one| one.value);
        let level = median(first.collect());
        for one in other
            .estimates
            .iter()
            .filter(|one| level > 0.0 && one.is_sound())
        {
            by_minute
                .entry(minute(one))
                .or_default()
                .push(one.value / level);
        }
    }
    let at = |one: &Estimate| {
        let values = by_minute.get(&minute(one))?;
        (values.len() >= LEAST_JOINTS).then(|| median(values.clone()))
    };
    Some(Warmth {
        covariate: Covariate::OtherJoints,
        values: series.estimates.iter().map(at).collect(),
    })
}
