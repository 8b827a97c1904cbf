//! Progress lines of a long computation, where no bar can be drawn. Pure: the time is an argument.

use std::time::Duration;

/// Time before the first line; shorter work prints none.
const FIRST_AFTER: Duration = Duration::from_secs(5);
/// Shortest time between a line and that of a new step.
const STEP_AFTER: Duration = Duration::from_secs(5);
/// Interval of the lines of a step that lasts.
const AGAIN_AFTER: Duration = Duration::from_secs(30);
/// Progress below which no remaining time is estimated.
const TELLING_FRACTION: f64 = 0.05;

/// Progress of the work.
#[derive(Debug)]
pub struct Far<'a> {
    /// Current step; empty if the work has only one.
    pub what: &'a str,
    /// Progress, from 0 to 1.
    pub fraction: f64,
    /// Time at which this progress was reached, from the start of the work.
    pub reached: Duration,
    /// Numbers of completed and of all recordings.
    pub counted: Option<(usize, usize)>,
}

/// Time and step of the last line.
#[derive(Debug, Default)]
pub struct Lines {
    told: Option<(Duration, String)>,
}

impl Lines {
    /// Returns the line that is due at `now`, measured from the start of the work, if any.
    pub fn due(&mut self, now: Duration, far: &Far<'_>) -> Option<String> {
        let due = match &self.told {
            None => FIRST_AFTER,
            Some((at, what)) if what != far.what => *at + STEP_AFTER,
            Some((at, _)) => *at + AGAIN_AFTER,
        };
        if now < due {
            return None;
        }
        self.told = Some((now, far.what.to_owned()));
        Some(line(now, far))
    }
}

fn line(now: Duration, far: &Far<'_>) -> String {
    let mut text = format!("{}: {:.0} %", words(now), (100.0 * far.fraction).floor());
    if let Some((done, all)) = far.counted {
        text += &format!(", {done} of {all} recordings");
    }
    if let Some(left) = left(now, far) {
        text += &format!(", about {} left", words(left));
    }
    if !far.what.is_empty() {
        text += &format!("; {}", far.what);
    }
    text
}

/// Extrapolates the remaining time linearly; `None` if little is done yet, or if the work takes longer than
/// extrapolated.
fn left(now: Duration, far: &Far<'_>) -> Option<Duration> {
    if far.fraction < TELLING_FRACTION {
        return None;
    }
    let rest_s = far.reached.as_secs_f64() * (1.0 - far.fraction) / far.fraction;
    let left_s = rest_s - now.saturating_sub(far.reached).as_secs_f64();
    (left_s >= 1.0).then(|| Duration::from_secs_f64(left_s))
}

/// Formats a time as `45 s`, `12 min` or `1 h 5 min`.
fn words(time: Duration) -> String {
    let seconds = time.as_secs_f64().round() as u64;
    match seconds {
        0..120 => format!("{seconds} s"),
        120..7200 => format!("{} min", (seconds + 30) / 60),
        _ => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn far(what: &str, fraction: f64, reached_s: u64) -> Far<'_> {
        Far {
            what,
            fraction,
            reached: Duration::from_secs(reached_s),
            counted: None,
        }
    }

    /// Returns the lines of work of this duration.
    fn lines<'a>(seconds: u64, at: impl Fn(u64) -> Far<'a>) -> Vec<String> {
        let mut lines = Lines::default();
        let all = (0..=seconds).filter_map(|s| lines.due(Duration::from_secs(s), &at(s)));
        all.collect()
    }

    #[test]
    fn short_work_says_nothing_and_a_long_step_every_half_minute() {
        assert!(lines(4, |_| far("reading", 0.5, 1)).is_empty());
        let said = lines(70, |_| far("point_ocsvm learns", 0.0, 0));
        let expected = ["5 s", "35 s", "65 s"].map(|at| format!("{at}: 0 %; point_ocsvm learns"));
        assert_eq!(said, expected);
    }

    #[test]
    fn each_step_is_told_but_not_many_a_second() {
        let names = ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k"];
        let said = lines(10, |s| far(names[s as usize], 0.0, 0));
        assert_eq!(said, ["5 s: 0 %; f", "10 s: 0 %; k"]);
    }

    #[test]
    fn what_is_left_is_told_once_it_can_be() {
        let said = |now_s, far: &Far<'_>| line(Duration::from_secs(now_s), far);
        assert_eq!(said(60, &far("x", 0.01, 60)), "60 s: 1 %; x");
        assert_eq!(
            said(60, &far("x", 0.1, 60)),
            "60 s: 10 %, about 9 min left; x"
        );
        assert_eq!(
            said(120, &far("x", 0.1, 60)),
            "2 min: 10 %, about 8 min left; x"
        );
        // The work takes longer than extrapolated.
        assert_eq!(said(900, &far("x", 0.1, 60)), "15 min: 10 %; x");
        let several = Far {
            counted: Some((3, 20)),
            ..far("", 0.16, 160)
        };
        assert_eq!(
            said(160, &several),
            "3 min: 16 %, 3 of 20 recordings, about 14 min left"
        );
        assert_eq!(words(Duration::from_mins(125)), "2 h 5 min");
    }
}
