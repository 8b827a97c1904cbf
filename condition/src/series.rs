//! Series of nightly estimates.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::robust::median;

/// Nights of learning before the first report. Resolution: two weeks have every day's work twice.
pub const LEARNED: usize = 14;
/// Half width of a 95 % interval of a normal variable, in standard deviations.
/// Statistical: the 97.5 % quantile of the standard normal distribution.
const HALF_WIDTH_95: f64 = 1.96;
/// Time constant of the warm-up of an arm \[h\].
/// Resolution: joints of arms take 0.5 to 2 hours; a covariate need only distinguish cold from warm.
const WARM_UP_H: f64 = 1.0;
/// Share of the estimates that must have a covariate for it to be used.
/// Resolution: a sensor that fails on some nights does not end its use.
const MOST: f64 = 0.9;
/// Fewest other joints for the use of their median.
/// Resolution: one joint of three that wears does not move it.
const LEAST_JOINTS: usize = 3;

/// Quantity that is estimated each night.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Coulomb friction of a joint.
    Coulomb,
    /// Viscous friction of a joint.
    Viscous,
    /// Ratio of the recorded effort of a joint's bodies to the modelled one.
    Gain,
    /// Unexplained constant part of a joint's effort.
    Offset,
    /// Backlash of a joint's gear.
    Backlash,
    /// Mass on the tool.
    Payload,
}

impl Quantity {
    /// All quantities.
    pub const ALL: [Self; 6] = [
        Self::Coulomb,
        Self::Viscous,
        Self::Gain,
        Self::Offset,
        Self::Backlash,
        Self::Payload,
    ];

    /// Name of the parameter with its unit, as in terms and tables.
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

    /// Name in words.
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

    /// Unit of the quantity. `effort` is the unit of efforts: `N m` or `A`.
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

    /// Smallest change to report at this level.
    /// Resolution: 5 K change the friction of many gears by 5 %, and below that no mechanic finds anything; 50 g are
    /// less than any tool. An offset has no level of its own: every detected change is reported.
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

/// Estimate of one night.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Time \[days since 1970-01-01 UTC\].
    pub day: f64,
    /// Estimated value.
    pub value: f64,
    /// Lower end of its 95 % interval.
    pub low: f64,
    /// Upper end of its 95 % interval.
    pub high: f64,
    /// Temperature of the joint \[deg C\].
    pub temperature_c: Option<f64>,
    /// Time since the start of the robot \[h\].
    pub hours_since_start: Option<f64>,
}

impl Estimate {
    /// Standard deviation of the error.
    pub fn deviation(&self) -> f64 {
        (self.high - self.low) / (2.0 * HALF_WIDTH_95)
    }

    /// Whether the estimate is finite and has an interval.
    pub(crate) fn is_sound(&self) -> bool {
        self.day.is_finite() && self.value.is_finite() && {
            let deviation = self.deviation();
            deviation.is_finite() && deviation > 0.0
        }
    }
}

/// Covariate for the warmth of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Covariate {
    /// Temperature of the joint \[deg C\].
    Temperature,
    /// Coldness by the time since the start of the robot: exp(-t / 1 h).
    TimeSinceStart,
    /// Quantity of the other joints, relative to its first nights: all joints of an arm warm up together.
    OtherJoints,
}

impl Covariate {
    /// Value at an estimate; `None` if it does not follow from the estimate alone.
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
    /// Joint; `None` for a quantity of the whole arm.
    pub joint: Option<String>,
    /// Estimated quantity.
    pub quantity: Quantity,
    /// Estimates, the oldest first.
    pub estimates: Vec<Estimate>,
}

/// Covariate of a series, by estimate.
#[derive(Debug, Clone)]
pub struct Warmth {
    /// Kind of the covariate.
    pub covariate: Covariate,
    /// Value at each estimate of the series, where known.
    pub values: Vec<Option<f64>>,
}

impl Warmth {
    /// Selects the covariate of a series: the temperature if known, otherwise the time since the start, otherwise,
    /// for friction, the other joints.
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

    /// Whether nearly all estimates have a value, and the values vary.
    fn is_known(&self) -> bool {
        let known: Vec<f64> = self.values.iter().flatten().copied().collect();
        let first = known.first().copied().unwrap_or(0.0);
        let varies = known.iter().any(|value| (value - first).abs() > 1e-6);
        varies && known.len() as f64 >= MOST * self.values.len() as f64
    }
}

/// Median of the other joints' friction, each relative to its first nights.
fn others(series: &Series, all: &[Series]) -> Option<Warmth> {
    if !series.quantity.is_friction() {
        return None;
    }
    // Estimates of one night have equal stamps, to the minute.
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
