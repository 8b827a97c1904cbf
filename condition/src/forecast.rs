//! Forecast of the time until a limit is reached, as an interval of days; none where the slope may be zero.

use serde::{Deserialize, Serialize};

use crate::robust::{median, theil_sen};
use crate::series::{Estimate, Warmth};
use crate::watch::Event;

/// Limit, as a multiple of the level before the drift.
/// Resolution: gears are opened at half as much friction again; a plant sets its own limit from its own gears.
pub const LIMIT: f64 = 1.5;
/// Fewest nights of a drift for a forecast. Resolution: the slopes of ten nights have a useful interval.
const LEAST_NIGHTS: usize = 10;

/// Forecast of the time until a limit is reached.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Forecast {
    /// Limit, in the unit of the quantity.
    pub limit: f64,
    /// 95 % interval of the time from the newest night to the limit, from that of the slope \[days\].
    pub days: [f64; 2],
    /// 95 % interval of the change per day.
    pub slope_per_day: [f64; 2],
}

/// Extrapolates a drift with the median of slopes (Theil and Sen) of the estimates since its onset, corrected for the
/// covariate. The interval of the slope is combined with that of the whole fit, which includes the uncertainty of
/// warmth and level. Returns `None` if the slope's interval covers zero, if the slope leads away from the limit, or
/// if the limit is exceeded already.
pub fn forecast(
    estimates: &[Estimate],
    warmth: Option<&Warmth>,
    event: &Event,
) -> Option<Forecast> {
    let limit = LIMIT * event.level;
    let free = |(at, estimate): (usize, &Estimate)| {
        let covariate = match warmth {
            Some(warmth) => warmth.values[at]? - event.centre,
            None => 0.0,
        };
        let counts = estimate.is_sound() && estimate.day >= event.from;
        counts.then_some((estimate.day, estimate.value - event.slope * covariate))
    };
    let points: Vec<(f64, f64)> = estimates.iter().enumerate().filter_map(free).collect();
    if points.len() < LEAST_NIGHTS {
        return None;
    }
    let now = points.last()?.0;
    let (slope, [low, high]) = theil_sen(&points)?;
    let of_fit = slope * 0.5 * (event.interval[1] - event.interval[0]) / event.size;
    let half = (0.5 * (high - low)).hypot(of_fit);
    let slopes = [slope - half, slope + half];
    let toward = (limit - event.level).signum();
    if !slopes.iter().all(|slope| slope * toward > 0.0) {
        return None;
    }
    let days = |slope: f64| {
        let rest = points
            .iter()
            .map(|(day, value)| value - slope * (day - now));
        (limit - median(rest.collect())) / slope
    };
    let middle = days(slope);
    let of_level = 1.96 * LIMIT * event.level_deviation / slope;
    let mut ends = slopes.map(days);
    ends.sort_by(f64::total_cmp);
    let ends = [
        middle - (middle - ends[0]).hypot(of_level),
        middle + (ends[1] - middle).hypot(of_level),
    ];
    (middle > 0.0).then_some(Forecast {
        limit,
        days: ends.map(|day| day.max(0.0)),
        slope_per_day: slopes,
    })
}
