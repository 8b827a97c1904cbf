//! Gaps in a stream, across restarts of its sender.

use super::{Position, Received, ReceiverCounts};
use crate::sample::{MOST_SAMPLES, Sample, Unsound, flags};

/// Tracks the sequence numbers that a receiver gets, and filters out invalid samples.
///
/// The sender's previous session is tracked as well: samples that a crashed sender left behind may be read after the
/// first samples of its successor.
#[derive(Debug, Default)]
pub(crate) struct Tracker {
    stream: String,
    present: Option<Position>,
    former: Option<Position>,
    counts: ReceiverCounts,
    /// Resumed from an earlier incarnation of this receiver, which had counters of its own.
    resumed: bool,
    /// The sender's current session has ended the stream.
    ended: bool,
}

impl Tracker {
    pub(crate) fn of(stream: &str) -> Self {
        Self {
            stream: stream.to_owned(),
            ..Self::default()
        }
    }

    /// Records a sequence number. Returns false for a sample older than one already received: it counts as lost and
    /// must not be passed on.
    fn note(&mut self, instance: u64, sequence: u64) -> bool {
        // Sequence numbers of valid samples are smaller.
        let Some(next) = sequence.checked_add(1) else {
            return false;
        };
        let known = [&mut self.present, &mut self.former]
            .into_iter()
            .flatten()
            .find(|position| position.instance == instance);
        if let Some(position) = known {
            let Some(hole) = sequence.checked_sub(position.next) else {
                return false;
            };
            self.counts.lost = self.counts.lost.saturating_add(hole);
            position.next = next;
            return true;
        }
        if self.present.is_some() {
            // A new session counts from 0, and this receiver was connected: all samples before this one are lost.
            self.counts.lost = self.counts.lost.saturating_add(sequence);
        }
        self.former = self.present.replace(Position { instance, next });
        self.ended = false;
        true
    }

    /// Sets the position at which the receiver connected, on its first message. Samples before it count as `before`,
    /// missing samples after it as lost.
    fn came_in(&mut self, begin: Option<Position>) {
        if let (None, Some(begin)) = (self.present, begin) {
            self.counts.before = self.counts.before.saturating_add(begin.next);
            self.present = Some(begin);
        }
    }

    /// Processes a message of the sender's session `instance` and passes its sample to `read`, unless it is the end
    /// of the stream. Returns `None` for a duplicate or a refused sample. `begin` is the position at which the
    /// receiver connected.
    pub(crate) fn take<T: Sample>(
        &mut self,
        begin: Option<Position>,
        instance: u64,
        sample: &T,
        read: &mut dyn FnMut(&T),
    ) -> Option<Received> {
        let header = sample.header();
        let soundness = sample.check();
        if let Err(why @ Unsound::Sequence(_)) = soundness {
            self.refuse(&why);
            return None;
        }
        self.came_in(begin);
        if !self.note(instance, header.sequence) {
            return None;
        }
        if let Err(why) = soundness {
            self.refuse(&why);
            return None;
        }
        if header.has(flags::END) {
            self.ended = true;
            return Some(Received::End);
        }
        self.counts.received += 1;
        read(sample);
        Some(Received::Sample)
    }

    /// Counts an invalid sample, with a warning for the first one.
    fn refuse(&mut self, why: &Unsound) {
        if self.counts.refused == 0 {
            let stream = &self.stream;
            tracing::warn!(
                "stream `{stream}`: a sample with {why} is refused; further ones are only counted"
            );
        }
        self.counts.refused += 1;
    }

    pub(crate) fn counts(&self) -> ReceiverCounts {
        self.counts
    }

    pub(crate) fn position(&self) -> Option<Position> {
        self.present
    }

    /// Processes the number of samples in all earlier sessions of the sender, which a new session announces. Those
    /// not received are lost or, if nothing was received yet, were sent before this receiver connected.
    pub(crate) fn hears_of_former_lives(&mut self, samples: u64) {
        let samples = samples.min(MOST_SAMPLES);
        // A session restarted within the same run announces at least the samples received here.
        if let Some(position) = self.present
            && samples < position.next
            && !self.ended
        {
            self.counts.broken_off += 1;
            let stream = &self.stream;
            tracing::warn!(
                "stream `{stream}`: its sender restarted without ending the stream; the number of samples in transit is \
                 unknown"
            );
        }
        let counts = &mut self.counts;
        let known = counts.received.saturating_add(counts.dropped());
        let missing = samples.saturating_sub(known);
        match self.present {
            None => counts.before = counts.before.saturating_add(missing),
            Some(_) if !self.resumed => counts.lost = counts.lost.saturating_add(missing),
            // The counters of the earlier incarnation of this receiver are unknown here.
            Some(_) => {}
        }
    }

    pub(crate) fn resume(&mut self, position: Position) {
        self.resumed = true;
        self.present = Some(position);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lost_after(heard: &[(u64, u64)]) -> u64 {
        let mut tracker = Tracker::default();
        for &(instance, sequence) in heard {
            tracker.note(instance, sequence);
        }
        tracker.counts().lost
    }

    #[test]
    fn a_late_joiner_has_lost_nothing() {
        assert_eq!(lost_after(&[(1, 70), (1, 71)]), 0);
    }

    #[test]
    fn what_is_missing_since_it_came_in_is_lost() {
        let mut tracker = Tracker::default();
        let begin = Position {
            instance: 1,
            next: 40,
        };
        tracker.came_in(Some(begin));
        tracker.note(1, 70);
        tracker.came_in(Some(begin));
        tracker.note(1, 71);
        assert_eq!(tracker.counts().lost, 30);
    }

    #[test]
    fn what_was_sent_before_it_came_in_is_known() {
        let mut tracker = Tracker::default();
        let begin = Position {
            instance: 1,
            next: 40,
        };
        tracker.came_in(Some(begin));
        tracker.came_in(Some(begin));
        assert_eq!((tracker.counts().before, tracker.counts().lost), (40, 0));
    }

    #[test]
    fn a_sample_that_no_stage_may_see_is_counted_and_no_hole() {
        let mut tracker = Tracker::of("c/s");
        let mut seen = 0;
        for sequence in 0..3 {
            let mut sample = crate::JointState::default();
            sample.header.sequence = sequence;
            if sequence == 1 {
                sample.header.joint_count = u32::MAX;
            }
            tracker.take(None, 7, &sample, &mut |_| seen += 1);
        }
        let mut far = crate::JointState::default();
        far.header.sequence = u64::MAX;
        assert_eq!(tracker.take(None, 7, &far, &mut |_| seen += 1), None);
        let counts = tracker.counts();
        assert_eq!((seen, counts.received), (2, 2));
        assert_eq!((counts.refused, counts.lost), (2, 0));
    }

    #[test]
    fn what_a_dead_sender_had_sent_is_known_from_its_next_life() {
        let mut tracker = Tracker::default();
        let hear = |tracker: &mut Tracker, instance, sequence| {
            let mut sample = crate::JointState::default();
            sample.header.sequence = sequence;
            let begin = Position {
                instance,
                next: sequence,
            };
            tracker.take(Some(begin), instance, &sample, &mut |_| {})
        };
        // Ten samples were sent before this receiver connected, and four were lost when their sender crashed.
        tracker.hears_of_former_lives(8);
        hear(&mut tracker, 1, 2);
        hear(&mut tracker, 1, 3);
        tracker.hears_of_former_lives(16);
        hear(&mut tracker, 2, 0);
        let counts = tracker.counts();
        assert_eq!((counts.before, counts.received, counts.lost), (10, 3, 4));
        tracker.hears_of_former_lives(u64::MAX);
        tracker.hears_of_former_lives(u64::MAX);
    }

    #[test]
    fn a_sender_that_another_run_has_started_anew_leaves_an_open_end() {
        let hear = |tracker: &mut Tracker, instance, sequence, flags| {
            let mut sample = crate::JointState::default();
            sample.header.sequence = sequence;
            sample.header.flags = flags;
            tracker.take(None, instance, &sample, &mut |_| {});
        };
        for (last, former, broken_off) in [(0, 0, 1), (flags::END, 0, 0), (0, 9, 0)] {
            let mut tracker = Tracker::of("c/s");
            tracker.hears_of_former_lives(0);
            for sequence in 0..7 {
                hear(&mut tracker, 1, sequence, 0);
            }
            hear(&mut tracker, 1, 7, last);
            tracker.hears_of_former_lives(former);
            hear(&mut tracker, 2, 0, 0);
            let told = tracker.counts().broken_off;
            assert_eq!(told, broken_off, "{last} {former}");
        }
    }

    #[test]
    fn numbers_at_their_limit_do_not_overflow() {
        let mut tracker = Tracker::default();
        assert!(!tracker.note(1, u64::MAX));
        assert!(tracker.note(1, u64::MAX - 1));
        assert!(tracker.note(2, u64::MAX - 1));
        assert!(tracker.note(3, u64::MAX - 1));
        assert_eq!(tracker.counts().lost, u64::MAX);
    }

    #[test]
    fn holes_are_counted() {
        assert_eq!(lost_after(&[(1, 0), (1, 3), (1, 4), (1, 10)]), 7);
    }

    #[test]
    fn a_restart_is_no_gap_but_what_is_missing_after_it_is() {
        assert_eq!(lost_after(&[(1, 1000), (2, 0), (2, 1)]), 0);
        assert_eq!(lost_after(&[(1, 1000), (2, 5)]), 5);
    }

    #[test]
    fn remains_of_the_former_life_are_followed() {
        assert_eq!(lost_after(&[(1, 0), (2, 0), (1, 1), (2, 1), (1, 3)]), 1);
    }

    #[test]
    fn what_comes_too_late_is_not_handed_on() {
        let mut tracker = Tracker::default();
        assert!(tracker.note(1, 4));
        assert!(!tracker.note(1, 4));
        assert!(!tracker.note(1, 2));
    }

    #[test]
    fn a_resumed_receiver_counts_from_where_it_was() {
        let mut tracker = Tracker::default();
        tracker.resume(Position {
            instance: 9,
            next: 10,
        });
        tracker.note(9, 15);
        assert_eq!(tracker.counts().lost, 5);
    }
}
