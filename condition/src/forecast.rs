//! When a limit is reached, as an interval of days; nothing where the slope may be zero.

use serde::{Deserialize, Serialize};

use crate::robust::{median, theil_sen};
use crate::series::{Estimate, Warmth};
use crate::watch::Event;

/// The limit, over the level before the drift.
/// Resolution: half as much friction again is what a gear is opened for; a plant sets its own by its own gears.
pub const LIMIT: f64 = 1.5;
/// Fewest nights of a drift that are extended. Resolution: ten nights' slopes have an interval of some use.
const LEAST_NIGHTS: usize = 10;

/// When a limit is reached.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Forecast {
    /// The limit.
    pub limit: f64,
    /// In how many days it is reached, from the newest night on: 95 % interval by that of the slope.
    pub days: [f64; 2],
    /// Change a day: 95 % interval.
    pub slope_per_day: [f64; 2],
}

/// The forecast of a drift: the median of slopes (Theil and Sen) of the estimates since it began, freed from what they go
/// with. To the interval of the slope that of the whole fit is added, which knows how well warmth and level are known.
/// `None` if the slope's interval covers zero, if it leads away from the limit, or if the limit is passed.
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
