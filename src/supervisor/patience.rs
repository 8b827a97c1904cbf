//! Wait for a stage that was asked to end.

use std::time::Duration;

use tokio::time::Instant;

/// Time after the request to end, or after the newest sample since, after which a stage that still runs is reported.
const NAMED_AFTER: Duration = Duration::from_secs(2);
/// Time after which it is killed.
const KILLED_AFTER: Duration = Duration::from_secs(10);
/// Time after which a recorder is killed. It may have to write much to a slow disk; killed, it would leave a `.part`.
const RECORDER_KILLED_AFTER: Duration = Duration::from_mins(1);

/// The wait for one stage to end.
#[derive(Debug)]
pub struct Patience {
    since: Instant,
    killed_after: Duration,
    named: bool,
    killed: bool,
}

/// Action on a stage that does not end.
#[derive(Debug, PartialEq, Eq)]
pub enum Overdue {
    /// Report it; it is killed after this time.
    Name(Duration),
    /// Kill it.
    Kill,
}

impl Patience {
    /// Starts the wait for a stage that is asked to end now.
    pub fn new(recorder: bool, now: Instant) -> Self {
        Self {
            since: now,
            killed_after: if recorder {
                RECORDER_KILLED_AFTER
            } else {
                KILLED_AFTER
            },
            named: false,
            killed: false,
        }
    }

    /// Restarts the wait: the stage still takes samples.
    pub fn extend(&mut self, now: Instant) {
        self.since = now;
    }

    /// Returns the action that is due at `now`; each action once.
    pub fn overdue(&mut self, now: Instant) -> Option<Overdue> {
        let waited = now.duration_since(self.since);
        if waited >= self.killed_after && !self.killed {
            self.killed = true;
            return Some(Overdue::Kill);
        }
        if waited >= NAMED_AFTER && !self.named {
            self.named = true;
            return Some(Overdue::Name(self.killed_after.saturating_sub(waited)));
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_named_then_killed_and_lives_longer_while_it_takes_samples() {
        let start = Instant::now();
        let at = |s| start + Duration::from_secs(s);
        let mut patience = Patience::new(false, start);
        assert_eq!(patience.overdue(at(1)), None);
        assert_eq!(
            patience.overdue(at(2)),
            Some(Overdue::Name(Duration::from_secs(8)))
        );
        assert_eq!(patience.overdue(at(3)), None);
        patience.extend(at(5));
        assert_eq!(patience.overdue(at(14)), None);
        assert_eq!(patience.overdue(at(15)), Some(Overdue::Kill));
        assert_eq!(patience.overdue(at(16)), None);
        let mut recorder = Patience::new(true, start);
        assert_eq!(
            recorder.overdue(at(2)),
            Some(Overdue::Name(Duration::from_secs(58)))
        );
        assert_eq!(recorder.overdue(at(59)), None);
        assert_eq!(recorder.overdue(at(60)), Some(Overdue::Kill));
    }
}
