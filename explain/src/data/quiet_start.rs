//! Duration of the undisturbed start of a recording of an arm at rest: a push in its first second is not part of the
//! baseline load.

use crate::data::noise::MEDIAN_OF_ABS_NORMAL;

/// Length of the windows whose means are compared \[s\].
/// Resolution: a push that begins within the first window is treated as load.
const WINDOW_S: f64 = 0.25;
/// Smallest deviation of a window's mean from that of the first window that ends the undisturbed start, in standard
/// deviations of the change between windows.
/// Statistical: a normal variable does so in none of 1e22 windows; slow noise of a second in none of 1e6.
const LEFT: f64 = 10.0;
/// Smallest number of windows for an estimate of the noise.
/// Statistical: the median of fewer changes may be that of a push.
const LEAST_WINDOWS: usize = 12;

/// Returns the duration of the undisturbed start of a recording, at most `most_s` \[s\]. `off` is the difference
/// between measured effort and twin by joint.
pub fn quiet_s(time_s: &[f64], off: &[Vec<f64>], most_s: f64) -> f64 {
    let each = off.iter().map(|off| of_joint(time_s, off, most_s));
    each.fold(most_s, f64::min)
}

fn of_joint(time_s: &[f64], off: &[f64], most_s: f64) -> f64 {
    let (Some(first), Some(last)) = (time_s.first(), time_s.last()) else {
        return most_s;
    };
    let count = ((last - first) / WINDOW_S) as usize;
    let mean = |window: usize| {
        let from = time_s.partition_point(|t| *t < first + WINDOW_S * window as f64);
        let to = time_s.partition_point(|t| *t < first + WINDOW_S * (window + 1) as f64);
        let own = &off[from.min(off.len())..to.min(off.len())];
        own.iter().sum::<f64>() / own.len().max(1) as f64
    };
    let means: Vec<f64> = (0..count).map(mean).collect();
    let mut changes: Vec<f64> = means.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    changes.sort_by(f64::total_cmp);
    if means.len() < LEAST_WINDOWS {
        return most_s;
    }
    let usual = changes[changes.len() / 2] / MEDIAN_OF_ABS_NORMAL;
    let within = (most_s / WINDOW_S).ceil() as usize;
    let left = |window: &usize| (means[*window] - means[0]).abs() > LEFT * usual;
    let window = (1..within.min(count)).find(left);
    window.map_or(most_s, |window| WINDOW_S * window as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::Noise;

    /// Returns the undisturbed start of ten seconds of slow noise with a push of 5 N m that lasts from `begins_s` for
    /// a second.
    fn quiet(begins_s: f64) -> f64 {
        let mut noise = Noise(8);
        let mut slow = 0.0;
        let time_s: Vec<f64> = (0..2000).map(|k| 0.005 * f64::from(k)).collect();
        let off = time_s.iter().map(|t| {
            slow = 0.99 * slow + 0.14 * noise.next();
            let push = f64::from(u8::from(*t >= begins_s && *t < begins_s + 1.0));
            0.1 * slow + 0.1 * noise.next() + 5.0 * push
        });
        let off: Vec<f64> = off.collect();
        quiet_s(&time_s, &[vec![0.0; 2000], off], 1.0)
    }

    #[test]
    fn the_beginning_ends_where_a_push_begins() {
        assert!(quiet(0.6) <= 0.6 && quiet(0.6) >= 0.25);
        assert!(quiet(0.3) >= 0.25 && quiet(0.3) < 0.31);
    }

    #[test]
    fn slow_noise_and_a_later_push_leave_the_first_second_as_it_is() {
        assert!((quiet(4.0) - 1.0).abs() < 1e-12);
        assert!((quiet(1e9) - 1.0).abs() < 1e-12);
    }
}
