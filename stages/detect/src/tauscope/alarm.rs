//! When a contact is said to be there.

use super::windows::Windows;

/// An alarm ends where the score has stayed below this share of the threshold.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const RELEASE: f64 = 0.35;
/// Or below this share of the largest score of the contact, as far as that is no more than the threshold: once less than
/// a tenth of the residual is left, the rest is how an arm under a stiff controller swings back onto its path.
/// Tuned: on seeds 811 and 812 of `tests/contacts/cyclic.py` with `reference_twin.py` and 841 of `paths.py`, swept over
/// 0, 0.0025, 0.01 and 0.04 ([docs/papers.md](../../../../docs/papers.md#time-in-alarm-after-a-contact)).
const GONE: f64 = 0.01;
/// For so long \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const HOLD_S: f64 = 0.1;
/// Another contact on top of one: the residual changes by this many times the threshold against what it has been, and that is no
/// release.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const CHANGE: f64 = 2.0;
/// What the residual has been is followed with this time constant \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const FOLLOW_S: f64 = 0.15;
/// Another contact does not begin sooner than this after the last alarm \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const AGAIN_S: f64 = 0.25;
/// One contact may swell and still be one: the change must be this share of what it has been as well.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const SWELL: f64 = 0.5;
/// Where kinds are told apart, it is another one, too, if the change points elsewhere: no more than this share of it along the contact (the cosine).
/// Tuned: on the sets named in [`tauscope`](crate::tauscope), where kinds are told; not swept.
const ELSEWHERE: f64 = 0.92;
/// A contact that only falls is released: its change points against it by more than this (the cosine).
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const FALLS: f64 = 0.7;
/// After this \[s\] instead of [`AGAIN_S`], one that is as large as a swell would have to be and points elsewhere.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope), where kinds are told; not swept.
const SOON_S: f64 = 0.1;
/// It points elsewhere: no more than this share of it lies along the contact (the cosine).
/// Tuned: on the sets named in [`tauscope`](crate::tauscope), where kinds are told; not swept.
const TURNS: f64 = 0.5;
/// Where kinds are told, the alarm waits so long for the force to show where it points \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope), where kinds are told; not swept.
const DECIDE_S: f64 = 0.012;
/// A score from this share of the threshold on may already belong to a contact.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const LOW: f64 = 0.3;
/// An alarm that lasts.
#[derive(Debug)]
#[allow(clippy::struct_field_names, reason = "a unit stands in each name")]
struct Alarm {
    contact_ns: i64,
    raised_ns: i64,
    newest_high_ns: i64,
    newest_ns: i64,
    /// The largest score since it was raised.
    largest: f64,
}

impl Alarm {
    /// The score below which the contact seems to be over.
    fn release(&self, threshold: f64) -> f64 {
        (GONE * self.largest).clamp(RELEASE * threshold, threshold)
    }
}

/// Follows a score.
#[derive(Debug)]
pub(crate) struct Watch {
    threshold: f64,
    /// Whether kinds are told.
    tells_kinds: bool,
    alarm: Option<Alarm>,
    /// Newest sample whose score was usual.
    newest_low_ns: Option<i64>,
    /// When the score rose above the threshold, while the alarm waits, or when another contact came on top.
    waits_since_ns: Option<i64>,
}

fn ns(seconds: f64) -> i64 {
    (seconds * 1e9) as i64
}

impl Watch {
    pub fn new(threshold: f64, tells_kinds: bool) -> Self {
        Self {
            threshold,
            tells_kinds,
            alarm: None,
            newest_low_ns: None,
            waits_since_ns: None,
        }
    }

    pub fn threshold(&self) -> f64 {
        self.threshold
    }

    /// From now on the threshold is another one.
    pub fn retune(&mut self, threshold: f64) {
        self.threshold = threshold;
    }

    pub fn reset(&mut self) {
        self.end();
        self.newest_low_ns = None;
    }

    /// No contact is there.
    pub fn end(&mut self) {
        self.alarm = None;
        self.waits_since_ns = None;
    }

    /// When the contact that is there began, if there is one.
    pub fn contact_ns(&self) -> Option<i64> {
        self.alarm.as_ref().map(|alarm| alarm.contact_ns)
    }

    /// When the alarm was raised that lasts.
    pub fn raised_ns(&self) -> Option<i64> {
        self.alarm.as_ref().map(|alarm| alarm.raised_ns)
    }

    /// Takes the next score; where an alarm is raised by it, says since when it has been on its way \[ns\].
    pub fn step(&mut self, now_ns: i64, score: f64, windows: &mut Windows) -> Option<i64> {
        let raised = if self.alarm.is_some() {
            self.on_top(now_ns, score, windows)
        } else {
            self.out_of_rest(now_ns, score, windows)
        };
        if score < LOW * self.threshold || self.newest_low_ns.is_none() {
            self.newest_low_ns = Some(now_ns);
            windows.rest();
        }
        raised
    }

    /// Whether the alarm has waited long enough, if it is to wait.
    fn decides(&mut self, now_ns: i64) -> Option<i64> {
        let since_ns = *self.waits_since_ns.get_or_insert(now_ns);
        let decides = !self.tells_kinds || now_ns - since_ns >= ns(DECIDE_S);
        decides.then(|| {
            self.waits_since_ns = None;
            since_ns
        })
    }

    fn out_of_rest(&mut self, now_ns: i64, score: f64, windows: &mut Windows) -> Option<i64> {
        if score < self.threshold && self.waits_since_ns.is_none() {
            return None;
        }
        if score < RELEASE * self.threshold {
            self.waits_since_ns = None;
            return None;
        }
        let since_ns = self.decides(now_ns)?;
        let contact_ns = self.newest_low_ns.unwrap_or(now_ns);
        self.raise(now_ns, contact_ns, score);
        windows.begin(false);
        Some(since_ns)
    }

    fn on_top(&mut self, now_ns: i64, score: f64, windows: &mut Windows) -> Option<i64> {
        let alarm = self.alarm.as_mut()?;
        alarm.largest = alarm.largest.max(score);
        if score >= alarm.release(self.threshold) {
            alarm.newest_high_ns = now_ns;
        }
        let dt_s = (now_ns - alarm.newest_ns) as f64 * 1e-9;
        alarm.newest_ns = now_ns;
        if now_ns - alarm.newest_high_ns >= ns(HOLD_S) {
            self.end();
            return None;
        }
        let since_ns = now_ns - alarm.raised_ns;
        let change = windows.change();
        let waits =
            self.waits_since_ns.is_some() && change.size > RELEASE * CHANGE * self.threshold;
        let along = change.along / (change.size * change.held).sqrt().max(f64::MIN_POSITIVE);
        let is_large = change.size > SWELL * change.held;
        let rested = since_ns > ns(AGAIN_S) || since_ns > ns(SOON_S) && is_large && along < TURNS;
        let is_other = is_large || self.tells_kinds && along < ELSEWHERE;
        let again = rested
            && score >= self.threshold
            && (windows.grows() || is_large && along > -FALLS)
            && change.size > CHANGE * self.threshold
            && is_other;
        if !(again || waits) {
            self.waits_since_ns = None;
            windows.hold(1.0 - (-dt_s / FOLLOW_S).exp());
            return None;
        }
        let since_ns = self.decides(now_ns)?;
        self.raise(now_ns, since_ns, score);
        windows.begin(true);
        Some(since_ns)
    }

    fn raise(&mut self, now_ns: i64, contact_ns: i64, score: f64) {
        self.alarm = Some(Alarm {
            contact_ns,
            raised_ns: now_ns,
            newest_high_ns: now_ns,
            newest_ns: now_ns,
            largest: score,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contact_is_over_where_a_tenth_is_left_of_it_but_not_above_the_threshold() {
        let release = |largest| {
            let alarm = Alarm {
                contact_ns: 0,
                raised_ns: 0,
                newest_high_ns: 0,
                newest_ns: 0,
                largest,
            };
            alarm.release(2.0)
        };
        let is = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} is not {b}");
        is(release(4.0), 2.0 * RELEASE);
        is(release(120.0), 1.2);
        is(release(5000.0), 2.0);
    }
}
