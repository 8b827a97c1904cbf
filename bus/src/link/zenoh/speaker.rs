//! Who may speak on a stream.

use std::collections::HashSet;

/// The lives of the stream's sender. A sender that lives shows a token; while it does, nobody else is heard, and who
/// shows none is not heard at all.
#[derive(Debug, Default)]
pub(super) struct Speakers {
    alive: HashSet<u64>,
    present: Option<u64>,
    /// The present one has ended its stream.
    ended: bool,
}

impl Speakers {
    /// A token has appeared.
    pub(super) fn appeared(&mut self, instance: u64) {
        self.alive.insert(instance);
    }

    /// A token has gone. What that sender has left on its way is still heard.
    pub(super) fn gone(&mut self, instance: u64) {
        self.alive.remove(&instance);
    }

    /// Whether that one may speak now.
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

    /// An earlier life of this receiver has heard that one.
    pub(super) fn resume(&mut self, instance: u64) {
        self.present.get_or_insert(instance);
    }

    /// That one has ended its stream.
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
