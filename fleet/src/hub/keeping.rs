//! Handling of a store that temporarily cannot be written: events are queued meanwhile, and the failure is reported.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use crate::keeper::{Deed, Keeper};
use crate::store::StoreError;
use crate::wall::{Effect, Snapshot, Wall};

/// Maximum number of queued events. Resolution: memory; a day of a busy plant.
const MOST: usize = 10_000;
/// Interval between tests whether the file can be written again. Resolution: a person sees no more.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// An event to be stored.
#[derive(Debug)]
enum News {
    Effect(Effect),
    Deed(Deed),
}

impl News {
    fn keep(&self, keeper: &mut Keeper, wall: &Wall, at_ns: i64) -> Result<(), StoreError> {
        match self {
            Self::Effect(effect) => keeper.keep(wall, effect, at_ns),
            Self::Deed(deed) => keeper.take(deed, at_ns),
        }
    }
}

/// A keeper whose file may fail.
#[derive(Debug)]
pub struct Keeping {
    keeper: Keeper,
    failing: Option<Failing>,
    /// Events to be stored, with their times \[ns since the epoch\].
    waiting: VecDeque<(News, i64)>,
    /// Number of events that were dropped because the queue was full.
    lost: u64,
}

#[derive(Debug)]
struct Failing {
    why: String,
    looked: Instant,
}

impl Keeping {
    pub fn new(keeper: Keeper) -> Self {
        Self {
            keeper,
            failing: None,
            waiting: VecDeque::new(),
            lost: 0,
        }
    }

    /// Stores an effect, now or once the file can be written.
    pub fn keep(&mut self, wall: &Wall, effect: Effect, now_ns: i64) {
        if self.failing.is_none() || effect.is_kept() {
            self.keep_news(wall, News::Effect(effect), now_ns);
        }
    }

    /// Stores a user's action, now or once the file can be written.
    pub fn take(&mut self, wall: &Wall, deed: Deed, now_ns: i64) {
        self.keep_news(wall, News::Deed(deed), now_ns);
    }

    fn keep_news(&mut self, wall: &Wall, news: News, now_ns: i64) {
        if self.failing.is_none() {
            match news.keep(&mut self.keeper, wall, now_ns) {
                Ok(()) => return,
                Err(error) => self.fails(&error),
            }
        }
        if self.waiting.len() == MOST {
            self.waiting.pop_front();
            self.lost += 1;
        }
        self.waiting.push_back((news, now_ns));
    }

    /// Does the periodic work, and stores the queued events once the file can be written again.
    pub fn tick(&mut self, wall: &Wall, snapshot: &mut Snapshot) {
        self.look(wall);
        self.keeper.compare(snapshot);
        if self.failing.is_none()
            && let Err(error) = self.keeper.tick(snapshot)
        {
            self.fails(&error);
        }
        snapshot.unkept = self.failing.as_ref().map(|failing| failing.why.clone());
    }

    fn look(&mut self, wall: &Wall) {
        let Some(failing) = &mut self.failing else {
            return;
        };
        if failing.looked.elapsed() < LOOK_EVERY {
            return;
        }
        failing.looked = Instant::now();
        if self.keeper.store().is_writable().is_err() {
            return;
        }
        let count = self.waiting.len();
        while let Some((news, at_ns)) = self.waiting.pop_front() {
            if news.keep(&mut self.keeper, wall, at_ns).is_err() {
                self.waiting.push_front((news, at_ns));
                return;
            }
        }
        self.failing = None;
        self.keeper.store().waits_for_others(true);
        let lost = std::mem::take(&mut self.lost);
        tracing::warn!("incidents are kept again: {count} that waited are kept, {lost} are lost");
    }

    fn fails(&mut self, error: &StoreError) {
        if self.failing.is_some() {
            return;
        }
        let why = error.to_string();
        tracing::warn!("incidents are not kept: {why}; they wait until they can be");
        // The wall must not block on a file that another program holds.
        self.keeper.store().waits_for_others(false);
        self.failing = Some(Failing {
            why,
            looked: Instant::now(),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;
    use crate::store::{Label, Note, Store};
    use tauscope_publish::message::Record;

    #[test]
    fn what_people_do_while_somebody_holds_the_file_is_kept_later() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fleet.sqlite");
        let mut keeping = Keeping::new(Keeper::new(Store::open(&path).unwrap()));
        let (wall, other) = (Wall::new(std::iter::empty()), Store::open(&path).unwrap());
        let contact = Effect::Recorded {
            cell: "a".to_owned(),
            instance: "x".to_owned(),
            number: 1,
            told_ns: 6,
            record: Box::new(Record::Contact(fixture::contact(1, 5))),
        };
        keeping.keep(&wall, contact, 6);
        other.hold().unwrap();
        let (cell, by) = ("a".to_owned(), "anna".to_owned());
        let note = Note {
            at_ns: 7,
            by: by.clone(),
            text: "new gear".to_owned(),
            baseline: true,
        };
        let label = Label {
            at_ns: 8,
            stamp_ns: 8,
            by: by.clone(),
            text: "hit the fixture".to_owned(),
        };
        for deed in [
            Deed::Noted {
                cell: cell.clone(),
                note: note.clone(),
            },
            Deed::Labelled {
                cell: cell.clone(),
                label: label.clone(),
            },
            Deed::Acknowledged { cell, by },
        ] {
            keeping.take(&wall, deed, 9);
        }
        other.release().unwrap();
        let begin = Instant::now();
        let mut snapshot = wall.snapshot();
        while keeping.failing.is_some() {
            assert!(begin.elapsed() < Duration::from_mins(1));
            keeping.tick(&wall, &mut snapshot);
            std::thread::sleep(Duration::from_millis(50));
        }
        assert_eq!(other.notes("a", 9).unwrap(), [note]);
        assert_eq!(other.labels(Some("a"), 9).unwrap()[0].label, label);
        let incident = other.incidents(None, 9).unwrap().remove(0);
        let acknowledged = (incident.acknowledged_ns, incident.acknowledged_by);
        assert_eq!(acknowledged, (Some(9), Some("anna".to_owned())));
    }

    #[test]
    fn what_happens_while_somebody_holds_the_file_is_kept_later_and_the_wall_goes_on() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fleet.sqlite");
        let mut keeping = Keeping::new(Keeper::new(Store::open(&path).unwrap()));
        let (wall, other) = (Wall::new(std::iter::empty()), Store::open(&path).unwrap());
        let contact = |number| Effect::Recorded {
            cell: "a".to_owned(),
            instance: "x".to_owned(),
            number,
            told_ns: 6_000_000_000,
            record: Box::new(Record::Contact(fixture::contact(number, 5))),
        };
        keeping.keep(&wall, contact(1), 0);
        other.hold().unwrap();
        let begin = Instant::now();
        (2..10).for_each(|number| keeping.keep(&wall, contact(number), 0));
        // It waits for the other program once, not for each contact.
        assert!(begin.elapsed() < Duration::from_secs(6), "{begin:?}");
        let mut snapshot = wall.snapshot();
        keeping.tick(&wall, &mut snapshot);
        let why = snapshot.unkept.take().unwrap();
        assert!(why.contains("another program holds it"), "{why}");
        other.release().unwrap();
        while keeping.failing.is_some() {
            assert!(begin.elapsed() < Duration::from_mins(1));
            keeping.tick(&wall, &mut snapshot);
            std::thread::sleep(Duration::from_millis(50));
        }
        assert_eq!((snapshot.unkept, keeping.lost), (None, 0));
        assert_eq!(other.contacts("a", 100).unwrap().len(), 9);
    }
}
