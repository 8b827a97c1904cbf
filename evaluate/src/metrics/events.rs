//! Matching of detections to labelled events.

use tauscope_pipeline::tally::Event;

use crate::labels::{TrueEvent, Truth};

/// Tolerance before an event: an earlier detection may still match it, because labels are not more exact \[s\].
/// Chosen: two samples at 100 Hz, a common rate of labelled recordings; more would accept alarms before the contact.
pub const TOLERANCE_S: f64 = 0.02;
/// Tolerance after an event's end: a later detection may still match it, because filters are slow \[s\].
/// Chosen: the twin's low-pass of 4.5 Hz then keeps 7 % of a contact at most, √2 exp(-√2 π 4.5 Hz t); a later alarm
/// has another cause.
pub const AFTER_S: f64 = 0.15;
/// Time after a counted false alarm in which further ones are not counted \[s\].
/// Chosen: settling time of the twin's low-pass at 4.5 Hz, in which one disturbance may raise an alarm twice.
pub const MERGE_S: f64 = 0.25;
/// Largest excess of a labelled length over the last stamp, due to a sample period or rounding \[s\].
/// Derived: half a second, the largest rounding error of a length in whole seconds.
pub const LAST_S: f64 = 0.5;
/// Grid step for the time in alarm \[s\].
/// Resolution: the time in alarm is accurate to 10 ms per alarm.
const GRID_S: f64 = 0.01;

/// A labelled event and the detection that found it.
#[derive(Debug, Clone, Copy)]
pub struct Matched<'a> {
    /// The labelled event.
    pub event: &'a TrueEvent,
    /// The first detection of the event; `None` if it was missed.
    pub detection: Option<&'a Event>,
}

impl Matched<'_> {
    /// Delay from the beginning to the alarm \[s\].
    pub fn delay_s(&self) -> Option<f64> {
        Some(self.detection?.t - self.event.t_on)
    }
}

/// Detections of one recording matched to its labelled events.
#[derive(Debug, Clone)]
pub struct Matching<'a> {
    /// All events except ignored ones, in the order of their beginnings.
    pub events: Vec<Matched<'a>>,
    /// Detections that match no event.
    pub false_alarms: Vec<&'a Event>,
    /// Number of detections that begin outside every labelled contact, without tolerance before and after a contact,
    /// recovery time or merging.
    pub strict_false_alarms: usize,
}

impl<'a> Matching<'a> {
    /// Matches detections to events. A detection belongs to the latest-starting event that contains the alarm's
    /// stamp, where events are extended by [`TOLERANCE_S`] before and [`AFTER_S`] after. The first detection of an
    /// event finds it; later ones are not counted. A detection of no event is a false alarm, unless it comes within
    /// `recovery_s` of an event's end, or within [`MERGE_S`] of the last counted false alarm.
    pub fn of(truth: &'a Truth, detections: &'a [Event], recovery_s: f64) -> Self {
        let mut events: Vec<Matched<'a>> = (truth.events.iter())
            .map(|event| Matched {
                event,
                detection: None,
            })
            .collect();
        events.sort_by(|a, b| a.event.t_on.total_cmp(&b.event.t_on));
        let mut ordered: Vec<&Event> = detections.iter().collect();
        ordered.sort_by(|a, b| a.t.total_cmp(&b.t));
        let mut false_alarms: Vec<&Event> = Vec::new();
        for detection in ordered {
            let t = detection.t;
            let holds = |m: &&mut Matched<'_>| {
                (m.event.t_on - TOLERANCE_S..=m.event.t_off + AFTER_S).contains(&t)
            };
            if let Some(own) = events.iter_mut().rev().find(holds) {
                own.detection.get_or_insert(detection);
                continue;
            }
            let recovers =
                |m: &Matched<'_>| (m.event.t_on..=m.event.t_off + recovery_s).contains(&t);
            let counted = false_alarms
                .last()
                .is_some_and(|last| t - last.t <= MERGE_S);
            if !counted && !events.iter().any(recovers) {
                false_alarms.push(detection);
            }
        }
        let touched = |t: f64| {
            events
                .iter()
                .any(|m| (m.event.t_on..=m.event.t_off).contains(&t))
        };
        let strict_false_alarms = detections.iter().filter(|d| !touched(d.t)).count();
        events.retain(|matched| !matched.event.ignore);
        Self {
            events,
            false_alarms,
            strict_false_alarms,
        }
    }
}

/// Time in alarm outside contacts, and total time outside contacts \[s\], on a grid of 10 ms.
pub fn in_alarm(truth: &Truth, duration_s: f64, detections: &[Event]) -> (f64, f64) {
    let count = (duration_s / GRID_S).ceil().max(0.0) as usize;
    let (mut alarm, mut free) = (0_u64, 0_u64);
    for index in 0..count {
        let t = index as f64 * GRID_S;
        let busy = |e: &TrueEvent| (e.t_on - TOLERANCE_S..=e.t_off + AFTER_S).contains(&t);
        if truth.events.iter().any(busy) {
            continue;
        }
        free += 1;
        alarm += u64::from(detections.iter().any(|d| (d.t..=d.t_off).contains(&t)));
    }
    (alarm as f64 * GRID_S, free as f64 * GRID_S)
}

/// Length of a recording \[s\]: the labelled length, unless the samples end before it.
pub fn duration_s(truth: &Truth, last_s: f64) -> f64 {
    let labelled = truth
        .duration
        .filter(|duration| *duration <= last_s + LAST_S);
    labelled.unwrap_or(last_s)
}

/// Contact-free time of a recording \[s\]: its length minus the union of its labelled contacts. A contact on top of
/// another one (`during`) is subtracted on its own.
pub fn free_s(truth: &Truth, duration_s: f64) -> f64 {
    let within = |event: &TrueEvent| (event.t_on.max(0.0), event.t_off.min(duration_s));
    let (on_top, plain): (Vec<&TrueEvent>, Vec<&TrueEvent>) =
        (truth.events.iter()).partition(|event| event.during.is_some());
    let mut spans: Vec<(f64, f64)> = plain.into_iter().map(within).collect();
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut busy, mut until) = (0.0, 0.0_f64);
    for (on, off) in spans {
        busy += (off - on.max(until)).max(0.0);
        until = until.max(off);
    }
    let each = on_top.into_iter().map(within);
    busy += each.map(|(on, off)| (off - on).max(0.0)).sum::<f64>();
    (duration_s - busy).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(t_on: f64, t_off: f64, ignore: bool) -> TrueEvent {
        TrueEvent {
            t_on,
            t_off,
            ignore,
            ..TrueEvent::default()
        }
    }

    fn detection(t: f64) -> Event {
        Event {
            t,
            t_off: t + 0.1,
            t_contact: t,
            kind: "contact".to_owned(),
            link: None,
            other_link: None,
            joints: Vec::new(),
            force: None,
            peak_score: 1.0,
            size: None,
        }
    }

    fn truth(events: Vec<TrueEvent>) -> Truth {
        Truth {
            duration: Some(20.0),
            events,
        }
    }

    #[test]
    fn a_detection_belongs_to_the_latest_event_that_holds_it() {
        let truth = truth(vec![event(1.0, 3.0, false), event(2.0, 2.5, false)]);
        let found = [detection(0.99), detection(2.1), detection(2.2)];
        let matching = Matching::of(&truth, &found, 0.15);
        let delays: Vec<_> = matching.events.iter().map(Matched::delay_s).collect();
        assert!((delays[0].unwrap() + 0.01).abs() < 1e-12);
        assert!((delays[1].unwrap() - 0.1).abs() < 1e-12);
        assert!(matching.false_alarms.is_empty());
    }

    #[test]
    fn false_alarms_close_together_count_once_and_none_counts_in_the_recovery_time_after_a_contact()
    {
        let truth = truth(vec![event(10.0, 11.0, false)]);
        let times = [1.0, 1.2, 1.26, 9.97, 11.1, 11.2, 11.6];
        let found: Vec<_> = times.into_iter().map(detection).collect();
        let matching = Matching::of(&truth, &found, 0.5);
        let alarms: Vec<_> = matching.false_alarms.iter().map(|alarm| alarm.t).collect();
        assert_eq!(alarms, [1.0, 1.26, 9.97, 11.6]);
        assert_eq!(matching.strict_false_alarms, times.len());
        assert_eq!(matching.events[0].detection.map(|d| d.t), Some(11.1));
    }

    #[test]
    fn an_ignored_event_is_neither_missed_nor_false() {
        let truth = truth(vec![event(1.0, 2.0, true)]);
        let found = [detection(1.5)];
        let matching = Matching::of(&truth, &found, 0.15);
        assert!(matching.events.is_empty() && matching.false_alarms.is_empty());
        assert_eq!(matching.strict_false_alarms, 0);
    }

    #[test]
    fn time_in_alarm_is_counted_outside_contacts() {
        let truth = Truth {
            duration: None,
            events: vec![event(1.0, 1.5, false)],
        };
        let found = [
            Event {
                t_off: 0.495,
                ..detection(0.305)
            },
            Event {
                t_off: 1.4,
                ..detection(1.2)
            },
        ];
        let (alarm, free) = in_alarm(&truth, 2.0, &found);
        // 0.31 to 0.49 by 0.01; busy from 0.98 to 1.65.
        assert!((alarm - 0.19).abs() < 1e-9, "{alarm}");
        assert!((free - (2.0 - 0.68)).abs() < 0.011, "{free}");
        assert!((free_s(&truth, 2.0) - 1.5).abs() < 1e-12);
    }

    #[test]
    fn contacts_count_once_and_only_within_the_recording() {
        let free = |events| free_s(&truth(events), 20.0);
        let is = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} is not {b}");
        is(
            free(vec![event(1.0, 4.0, false), event(2.0, 5.0, false)]),
            16.0,
        );
        is(
            free(vec![event(-3.0, 1.0, false), event(18.0, 900.0, false)]),
            17.0,
        );
        is(
            free(vec![event(0.0, 900.0, false), event(0.0, 900.0, false)]),
            0.0,
        );
        let on_top = TrueEvent {
            during: Some("collision".to_owned()),
            ..event(2.0, 3.0, false)
        };
        is(free(vec![event(1.0, 4.0, false), on_top]), 16.0);
    }

    #[test]
    fn a_labelled_length_counts_unless_the_samples_end_before() {
        let labelled = |duration| Truth {
            duration: Some(duration),
            events: Vec::new(),
        };
        assert!((duration_s(&labelled(20.01), 20.0) - 20.01).abs() < f64::EPSILON);
        assert!((duration_s(&labelled(900.0), 20.0) - 20.0).abs() < f64::EPSILON);
    }
}
