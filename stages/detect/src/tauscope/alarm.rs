//! Beginning and end of an alarm, from the score.

use super::windows::Windows;
use crate::frame::DEFAULT_HOLD_S;

/// Share of the threshold below which the score must stay for an alarm to end.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const RELEASE: f64 = 0.35;
/// Share of the contact's largest score that replaces [`RELEASE`] where it is higher, up to the threshold. Once less
/// than a tenth of the residual is left, this rest comes from an arm under a stiff controller that swings back onto
/// its path.
/// Tuned: on seeds 811 and 812 of `tests/contacts/cyclic.py` with `reference_twin.py` and 841 of `paths.py`, swept
/// over 0, 0.0025, 0.01 and 0.04 ([docs/papers.md](../../../../docs/papers.md#time-in-alarm-after-a-contact)).
const GONE: f64 = 0.01;
/// Smallest change of the residual against the followed contact that can be another contact on top of it, as a
/// multiple of the threshold. A release does not count.
/// Derived: the change is a difference of two means of equal noise. It has twice the variance of one mean, and a
/// score is a square.
const CHANGE: f64 = 2.0;
/// Time constant with which the residual of a contact is followed \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const FOLLOW_S: f64 = 0.15;
/// Minimum time between an alarm and another contact on top of it \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const AGAIN_S: f64 = 0.25;
/// Smallest change that is another contact, as a share of the followed contact; a smaller one is a swell of the same
/// contact.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const SWELL: f64 = 0.5;
/// Cosine between change and contact below which even a change smaller than [`SWELL`] is another contact. It applies
/// only where contacts are classified.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope), with kinds reported; not swept.
const ELSEWHERE: f64 = 0.92;
/// Negative cosine between change and contact beyond which the change is a release, not another contact.
/// Chosen: about cos 45°, half-way between a release and a change across. A smaller one discards contacts across, a
/// larger one reports an uneven release as another contact.
const FALLS: f64 = 0.7;
/// Minimum time instead of [`AGAIN_S`] for a change larger than [`SWELL`] in another direction ([`TURNS`]) \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope), with kinds reported; not swept.
const SOON_S: f64 = 0.1;
/// Cosine between change and contact below which [`SOON_S`] applies.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope), with kinds reported; not swept.
const TURNS: f64 = 0.5;
/// Delay of an alarm where contacts are classified, in which the direction of the force becomes clear \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope), with kinds reported; not swept.
const DECIDE_S: f64 = 0.012;
/// Share of the threshold above which a score may already belong to a contact.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const LOW: f64 = 0.3;
/// An active alarm.
#[derive(Debug)]
#[allow(clippy::struct_field_names, reason = "a unit stands in each name")]
struct Alarm {
    contact_ns: i64,
    raised_ns: i64,
    newest_high_ns: i64,
    newest_ns: i64,
    /// Largest score since the alarm was raised.
    largest: f64,
}

impl Alarm {
    /// Returns the score below which the contact appears to be over.
    fn release(&self, threshold: f64) -> f64 {
        (GONE * self.largest).clamp(RELEASE * threshold, threshold)
    }
}

/// Raises and ends alarms from a score.
#[derive(Debug)]
pub(crate) struct Watch {
    threshold: f64,
    /// Whether contacts are classified.
    tells_kinds: bool,
    alarm: Option<Alarm>,
    /// Newest sample whose score was too low for a contact.
    newest_low_ns: Option<i64>,
    /// Start of a pending alarm: the time at which the score crossed the threshold, or another contact came on top.
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

    /// Sets another threshold.
    pub fn retune(&mut self, threshold: f64) {
        self.threshold = threshold;
    }

    pub fn reset(&mut self) {
        self.end();
        self.newest_low_ns = None;
    }

    /// Ends the alarm, also a pending one.
    pub fn end(&mut self) {
        self.alarm = None;
        self.waits_since_ns = None;
    }

    /// Returns the start of the present contact, if there is one.
    pub fn contact_ns(&self) -> Option<i64> {
        self.alarm.as_ref().map(|alarm| alarm.contact_ns)
    }

    /// Returns the time at which the present alarm was raised, if there is one.
    pub fn raised_ns(&self) -> Option<i64> {
        self.alarm.as_ref().map(|alarm| alarm.raised_ns)
    }

    /// Takes the next score. If it raises an alarm, returns the time since which the alarm has been pending \[ns\].
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

    /// Returns the time since which the alarm has been pending, unless the alarm has to wait longer.
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
        if now_ns - alarm.newest_high_ns >= ns(DEFAULT_HOLD_S) {
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
