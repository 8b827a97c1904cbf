//! Sender check: the session from which a receiver accepts samples.

use std::collections::HashSet;

/// Sessions of a stream's sender. A live session has a liveliness token. A new session is accepted only with a token,
/// and only after the current one has ended its stream or lost its token.
#[derive(Debug, Default)]
pub(super) struct Speakers {
    alive: HashSet<u64>,
    present: Option<u64>,
    /// The current session has ended its stream.
    ended: bool,
}

impl Speakers {
    /// Registers the token of a session.
    pub(super) fn appeared(&mut self, instance: u64) {
        self.alive.insert(instance);
    }

    /// Removes the token of a session. Its samples in transit are still accepted.
    pub(super) fn gone(&mut self, instance: u64) {
        self.alive.remove(&instance);
    }

    /// Whether samples of this session are accepted now.
    pub(super) fn hears(&mut self, instance: u64) -> bool {
        if self.present == Some(instance) {
            return true;
        }
        let lives = |instance| self.alive.contains(&instance);
        let is_free = self.ended || !self.present.is_some_and(lives);
        if !is_free || !lives(instance) {
            return false;
        }
        self.present = Some(instance);
        self.ended = false;
        true
    }

    /// Sets the session from which an earlier incarnation of this receiver accepted samples.
    pub(super) fn resume(&mut self, instance: u64) {
        self.present.get_or_insert(instance);
    }

    /// Marks the stream of a session as ended.
    pub(super) fn ends(&mut self, instance: u64) {
        self.ended |= self.present == Some(instance);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_speaks_without_a_token() {
        let mut speakers = Speakers::default();
        assert!(!speakers.hears(1));
        speakers.appeared(1);
        assert!(speakers.hears(1));
    }

    #[test]
    fn a_stranger_is_not_heard_while_the_sender_lives_and_its_next_life_is() {
        let mut speakers = Speakers::default();
        speakers.appeared(1);
        assert!(speakers.hears(1));
        speakers.appeared(2);
        assert!(!speakers.hears(2) && !speakers.hears(3));
        speakers.gone(1);
        assert!(speakers.hears(1), "what is still on its way");
        assert!(speakers.hears(2) && !speakers.hears(1) && !speakers.hears(3));
    }

    #[test]
    fn after_the_end_another_may_begin() {
        let mut speakers = Speakers::default();
        speakers.appeared(1);
        speakers.hears(1);
        speakers.appeared(2);
        speakers.ends(7);
        assert!(!speakers.hears(2));
        speakers.ends(1);
        assert!(speakers.hears(2));
    }

    #[test]
    fn a_receiver_that_was_started_again_knows_whom_it_heard() {
        let mut speakers = Speakers::default();
        speakers.resume(1);
        speakers.appeared(1);
        speakers.appeared(2);
        assert!(!speakers.hears(2) && speakers.hears(1));
    }
}
