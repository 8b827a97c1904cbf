//! Detection of changes in one series, with onset and end.

use crate::cusum::Cusum;
use crate::reference::Reference;
use crate::robust::median;
use crate::series::{Covariate, Estimate, LEARNED, Quantity, Warmth};
use crate::shape::{self, Point, Shape};

/// Deviation from which on a night is an outlier and is not learned \[standard deviations\].
/// Statistical: a normal variable exceeds it in 4 of 1e8 nights.
const WILD: f64 = 5.5;
/// Number of nights that represent the current state. Resolution: a working week.
const NEWEST: usize = 5;
/// Mean deviation of these nights below which a change is over \[standard deviations of one night\].
/// Statistical: without a change, the mean of five nights is below it in 93 % of cases.
const OVER: f64 = 0.8;
/// Prior of the slope against the time since the start, relative to that against temperature \[K\].
/// Physical: an arm warms by some 15 K.
const KELVINS_OF_A_START: f64 = 15.0;
/// Lower bound on the deviation of the slope's prior, relative to that of one night \[1/K\].
/// Statistical: two kelvins are then as much as one night's error.
const SLOPE_OF_DEVIATION: f64 = 0.5;

/// A change of one series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Shape of the change.
    pub shape: Shape,
    /// Onset \[days since 1970-01-01 UTC\].
    pub from: f64,
    /// Night of the detection \[days since 1970-01-01 UTC\].
    pub told: f64,
    /// End, if it is over \[days since 1970-01-01 UTC\].
    pub until: Option<f64>,
    /// Level before the change.
    pub level: f64,
    /// Standard deviation of the level.
    pub level_deviation: f64,
    /// Deviation from the level now, or during an episode.
    pub size: f64,
    /// 95 % interval of `size`.
    pub interval: [f64; 2],
    /// Change of the value per unit of the covariate.
    pub slope: f64,
    /// Centre of the covariate, to which the level refers.
    pub centre: f64,
}

/// Result of [`watch`] for one series.
#[derive(Debug, Clone)]
pub struct Watched {
    /// Changes, the oldest first.
    pub events: Vec<Event>,
    /// Isolated nights far from all others \[days\].
    pub outliers: Vec<f64>,
    /// Change of the value per unit of the covariate, and centre of the covariate.
    pub slope: [f64; 2],
}

/// Valid estimates of a series, each with its covariate, and the prior of their regression.
struct Nights<'a> {
    all: Vec<(&'a Estimate, f64)>,
    quantity: Quantity,
    has_slope: bool,
    slope_deviation: f64,
    centre: f64,
}

impl Nights<'_> {
    fn reference(&self, learned: impl Iterator<Item = usize>) -> Reference {
        let mut reference = Reference::new(self.slope_deviation, self.centre);
        for night in learned {
            let (estimate, covariate) = self.all[night];
            reference.learn(estimate, covariate);
        }
        reference
    }

    fn deviate(&self, reference: &Reference, night: usize) -> f64 {
        let (estimate, covariate) = self.all[night];
        reference.deviate(estimate, covariate)
    }

    /// Weighted mean of value minus prediction over some nights, and the half width of its 95 % interval.
    fn mean_off(&self, reference: &Reference, nights: std::ops::Range<usize>) -> (f64, f64) {
        let (mut sum, mut weights) = (0.0, 0.0);
        for (estimate, covariate) in &self.all[nights] {
            if let Some(expected) = reference.expects(*covariate, estimate.deviation()) {
                let weight = expected.deviation.powi(-2);
                sum += weight * (estimate.value - expected.value);
                weights += weight;
            }
        }
        if weights > 0.0 {
            (sum / weights, 1.96 * reference.scatter() / weights.sqrt())
        } else {
            (0.0, 0.0)
        }
    }

    fn point(&self, night: usize) -> Point {
        let (estimate, covariate) = self.all[night];
        Point {
            day: estimate.day,
            value: estimate.value,
            deviation: estimate.deviation(),
            covariate: covariate - self.centre,
        }
    }
}

/// A change in progress; `told` is the night in which it became large enough to be reported.
struct Open {
    begin: usize,
    told: Option<usize>,
}

/// Detects changes in the estimates since the newest baseline, the oldest first.
pub fn watch(estimates: &[Estimate], quantity: Quantity, warmth: Option<&Warmth>) -> Watched {
    let nights = nights(estimates, quantity, warmth);
    let count = nights.all.len();
    let mut watched = Watched {
        events: Vec::new(),
        outliers: Vec::new(),
        slope: [0.0, nights.centre],
    };
    if count <= LEARNED {
        return watched;
    }
    let mut learned: Vec<usize> = (0..LEARNED).collect();
    let mut reference = nights.reference(learned.iter().copied());
    let mut sums = Cusum::default();
    let mut open: Option<Open> = None;
    for night in LEARNED..count {
        let Some(change) = &mut open else {
            let deviate = nights.deviate(&reference, night);
            if let Some(begin) = sums.take(deviate, night) {
                learned.retain(|learned| *learned < begin);
                watched
                    .outliers
                    .retain(|day| *day < nights.all[begin].0.day);
                reference = nights.reference(learned.iter().copied());
                open = Some(Open { begin, told: None });
                told(&nights, &reference, &mut open, night);
            } else if deviate.abs() < WILD {
                reference.learn(nights.all[night].0, nights.all[night].1);
                learned.push(night);
            } else {
                watched.outliers.push(nights.all[night].0.day);
            }
            continue;
        };
        let begin = change.begin;
        told(&nights, &reference, &mut open, night);
        if night + 1 < begin + 2 * NEWEST {
            continue;
        }
        let newest = night + 1 - NEWEST..night + 1;
        let deviates = newest
            .clone()
            .map(|night| nights.deviate(&reference, night));
        if (deviates.sum::<f64>() / NEWEST as f64).abs() < OVER {
            let is_told = open.take().and_then(|change| change.told);
            if let Some(told) = is_told {
                let during = begin..newest.end;
                watched
                    .events
                    .push(episode(&nights, &reference, during, told));
            }
            learned.extend(newest);
            reference = nights.reference(learned.iter().copied());
            sums = Cusum::default();
        }
    }
    watched.slope[0] = reference.coefficients().map_or(0.0, |[_, slope]| slope);
    if let Some(Open {
        begin,
        told: Some(told),
    }) = open
    {
        watched
            .events
            .extend(lasting(&nights, &reference, &learned, begin, told));
    }
    watched
}

fn nights<'a>(
    estimates: &'a [Estimate],
    quantity: Quantity,
    warmth: Option<&Warmth>,
) -> Nights<'a> {
    let with = estimates.iter().enumerate().filter_map(|(at, estimate)| {
        let covariate = warmth.map_or(Some(0.0), |warmth| warmth.values[at])?;
        estimate.is_sound().then_some((estimate, covariate))
    });
    let all: Vec<(&Estimate, f64)> = with.collect();
    let first = || all.iter().take(LEARNED);
    let level = median(first().map(|(estimate, _)| estimate.value).collect()).abs();
    let deviation = median(first().map(|(estimate, _)| estimate.deviation()).collect());
    let slope = (quantity.slope_share() * level).max(SLOPE_OF_DEVIATION * deviation);
    let slope_deviation = match warmth.map(|warmth| warmth.covariate) {
        None => 0.0,
        Some(Covariate::Temperature) => slope,
        Some(Covariate::TimeSinceStart) => slope * KELVINS_OF_A_START,
        Some(Covariate::OtherJoints) => level,
    };
    let centre = median(first().map(|(_, covariate)| *covariate).collect());
    Nights {
        all,
        quantity,
        has_slope: warmth.is_some(),
        slope_deviation,
        centre,
    }
}

/// Marks an open change as reported, once it is large enough.
fn told(nights: &Nights<'_>, reference: &Reference, open: &mut Option<Open>, night: usize) {
    let Some(change) = open.as_mut().filter(|change| change.told.is_none()) else {
        return;
    };
    let newest = change.begin.max((night + 1).saturating_sub(NEWEST))..night + 1;
    let (off, _) = nights.mean_off(reference, newest);
    let level = reference.coefficients().map_or(0.0, |[level, _]| level);
    if off.abs() >= nights.quantity.relevant(level) {
        change.told = Some(night);
    }
}

/// A change that is over: the consecutive nights within `during` that deviate most.
fn episode(
    nights: &Nights<'_>,
    reference: &Reference,
    during: std::ops::Range<usize>,
    told: usize,
) -> Event {
    let off = |night: usize| {
        let (estimate, covariate) = nights.all[night];
        let expected = reference.expects(covariate, estimate.deviation());
        expected.map_or((0.0, 0.0), |expected| {
            let weight = expected.deviation.powi(-2);
            (weight * (estimate.value - expected.value), weight)
        })
    };
    let offs: Vec<(f64, f64)> = during.clone().map(off).collect();
    // Selects the nights for which a constant deviation explains the largest sum of squares.
    let (mut most, mut best) = (-1.0, (0, offs.len(), 0.0, 1.0));
    for first in 0..offs.len() {
        let (mut sum, mut weights) = (0.0, 0.0);
        for (last, (off, weight)) in offs.iter().enumerate().skip(first) {
            sum += off;
            weights += weight;
            if weights > 0.0 && sum * sum / weights > most {
                most = sum * sum / weights;
                best = (first, last + 1, sum / weights, weights);
            }
        }
    }
    let (first, end, size, weights) = best;
    let half = 1.96 * reference.scatter() / weights.sqrt();
    let [level, slope] = reference.coefficients().unwrap_or_default();
    let day = |night: usize| {
        nights.all[(during.start + night).min(nights.all.len() - 1)]
            .0
            .day
    };
    Event {
        shape: Shape::Episode,
        from: day(first),
        told: nights.all[told].0.day,
        until: Some(day(end)),
        level,
        level_deviation: 0.0,
        size,
        interval: [size - half, size + half],
        slope,
        centre: nights.centre,
    }
}

/// A lasting change: step or drift, fitted to the learned nights and those since.
fn lasting(
    nights: &Nights<'_>,
    reference: &Reference,
    learned: &[usize],
    begin: usize,
    told: usize,
) -> Option<Event> {
    let since = begin..nights.all.len();
    let points = learned.iter().copied().chain(since.clone());
    let points: Vec<Point> = points.map(|night| nights.point(night)).collect();
    // The onset is not after the detection; a later one belongs to another change.
    let told_day = nights.all[told].0.day;
    let change = shape::change(&points, nights.has_slope, told_day)?;
    let (off, half) = nights.mean_off(reference, since);
    // If the sign of the fitted change contradicts the mean deviation, the change is a step of that deviation.
    let (change_from, denied) = (change.from, change.size * off <= 0.0);
    Some(Event {
        shape: if denied { Shape::Step } else { change.shape },
        from: if denied {
            nights.all[begin].0.day
        } else {
            change_from
        },
        told: told_day,
        until: None,
        level: change.level,
        level_deviation: change.level_deviation,
        size: if denied { off } else { change.size },
        interval: if denied {
            [off - half, off + half]
        } else {
            change.interval
        },
        slope: change.slope,
        centre: nights.centre,
    })
}
