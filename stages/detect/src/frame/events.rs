//! Events from scores: the start and the end of an alarm.

/// State of the alarm at a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    /// No alarm.
    Free,
    /// The alarm is raised at this sample; the estimated start of the contact is `contact_ns`.
    Onset { contact_ns: i64 },
    /// The alarm persists.
    Contact { contact_ns: i64 },
    /// The alarm ends at this sample.
    Offset,
}

/// Default time for which a score must stay below the threshold before an alarm ends \[s\].
/// Chosen: bridges the dip of the score between two oscillations of one contact. A shorter time splits a contact, a
/// longer one merges two.
pub(crate) const DEFAULT_HOLD_S: f64 = 0.1;

/// The alarm's state.
#[derive(Debug)]
pub(crate) struct Alarm {
    threshold: f64,
    /// Score from which a sample may already belong to a contact: the search for the contact's start stops below it.
    low: f64,
    hold_ns: i64,
    /// Start of the contact, while an alarm lasts.
    contact_ns: Option<i64>,
    /// Newest sample below `low`, and newest at or above the threshold.
    newest_low_ns: Option<i64>,
    newest_high_ns: i64,
}

impl Alarm {
    /// Creates an alarm at `threshold`; a contact starts where the score last rose above `low`.
    pub fn new(threshold: f64, low: f64, hold_s: f64) -> Self {
        Self {
            threshold,
            low: low.min(threshold),
            hold_ns: (hold_s * 1e9) as i64,
            contact_ns: None,
            newest_low_ns: None,
            newest_high_ns: 0,
        }
    }

    pub fn threshold(&self) -> f64 {
        self.threshold
    }

    /// Processes the score of the sample at `stamp_ns`. `None` (detector not ready) ends an alarm and discards the
    /// history.
    pub fn step(&mut self, stamp_ns: i64, score: Option<f64>) -> Step {
        let Some(score) = score else {
            self.newest_low_ns = None;
            return if self.contact_ns.take().is_some() {
                Step::Offset
            } else {
                Step::Free
            };
        };
        // Equation 7: a score equal to the threshold raises the alarm, too.
        let high = score >= self.threshold;
        if high {
            self.newest_high_ns = stamp_ns;
        }
        let step = match self.contact_ns {
            None if high => {
                let contact_ns = self.newest_low_ns.unwrap_or(stamp_ns);
                self.contact_ns = Some(contact_ns);
                Step::Onset { contact_ns }
            }
            None => Step::Free,
            Some(contact_ns) if high || stamp_ns - self.newest_high_ns < self.hold_ns => {
                Step::Contact { contact_ns }
            }
            Some(_) => {
                self.contact_ns = None;
                Step::Offset
            }
        };
        if score < self.low {
            self.newest_low_ns = Some(stamp_ns);
        } else if self.newest_low_ns.is_none() {
            // Never low since the detector became ready: the earliest known start of a contact.
            self.newest_low_ns = Some(stamp_ns);
        }
        step
    }
}

/// The events of a detector with its own rules: an event lasts while its kind and its start are unchanged.
#[derive(Debug, Default)]
pub(crate) struct OwnEvents {
    /// Kind and start of the current event.
    open: Option<(&'static str, i64)>,
}

impl OwnEvents {
    /// Processes the detector's result for the next sample: its state, and the start of the contact.
    pub fn step(&mut self, state: Option<&'static str>, contact_ns: Option<i64>) -> Step {
        let now = state.zip(contact_ns);
        let before = std::mem::replace(&mut self.open, now);
        match now {
            Some((_, contact_ns)) if before == now => Step::Contact { contact_ns },
            Some((_, contact_ns)) => Step::Onset { contact_ns },
            None if before.is_some() => Step::Offset,
            None => Step::Free,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn steps(scores: &[f64]) -> Vec<Step> {
        let mut alarm = Alarm::new(10.0, 2.0, 0.025);
        (0..)
            .zip(scores)
            .map(|(i, &score)| alarm.step(i * 10 * MS, Some(score)))
            .collect()
    }

    #[test]
    fn a_contact_begins_where_the_score_left_its_usual_range() {
        let steps = steps(&[1.0, 1.0, 4.0, 8.0, 10.0, 11.0]);
        assert_eq!(steps[3], Step::Free);
        assert_eq!(
            steps[4],
            Step::Onset {
                contact_ns: 10 * MS
            }
        );
        assert_eq!(
            steps[5],
            Step::Contact {
                contact_ns: 10 * MS
            }
        );
    }

    #[test]
    fn a_short_dip_does_not_end_the_alarm_and_a_long_one_does() {
        let steps = steps(&[1.0, 12.0, 5.0, 12.0, 1.0, 1.0, 1.0, 1.0]);
        assert_eq!(steps[2], Step::Contact { contact_ns: 0 });
        assert_eq!(steps[5], Step::Contact { contact_ns: 0 });
        assert_eq!(steps[6], Step::Offset);
        assert_eq!(steps[7], Step::Free);
    }

    #[test]
    fn an_event_of_ones_own_ends_where_its_kind_or_its_beginning_changes() {
        let mut events = OwnEvents::default();
        let onset = |contact_ns| Step::Onset { contact_ns };
        assert_eq!(events.step(Some("free"), None), Step::Free);
        assert_eq!(events.step(Some("collision"), Some(1)), onset(1));
        let on = events.step(Some("collision"), Some(1));
        assert_eq!(on, Step::Contact { contact_ns: 1 });
        assert_eq!(events.step(Some("cooperation"), Some(1)), onset(1));
        assert_eq!(events.step(Some("cooperation"), Some(9)), onset(9));
        assert_eq!(events.step(None, None), Step::Offset);
        assert_eq!(events.step(None, None), Step::Free);
    }

    #[test]
    fn becoming_unready_ends_the_alarm() {
        let mut alarm = Alarm::new(10.0, 2.0, 1.0);
        alarm.step(0, Some(20.0));
        assert_eq!(alarm.step(MS, None), Step::Offset);
        assert_eq!(alarm.step(2 * MS, None), Step::Free);
    }
}
