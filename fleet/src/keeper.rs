//! Conversion of the wall's effects to stored incidents, contacts and minutes of the residual.

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use tauscope_publish::message::{ChangeMessage, ContactMessage, Record, StatusMessage};

use crate::store::{Aging, JointNormal, Kind, Label, News, Note, Said, Store, StoreError};
use crate::wall::{Effect, Remembered, ResidualView, Severity, Snapshot, State, UnknownWhy, Wall};
use crate::words;

const MINUTE_NS: i64 = 60_000_000_000;
const HOUR_NS: i64 = 60 * MINUTE_NS;
const DAY_NS: i64 = 24 * HOUR_NS;
/// Days of the curve on a tile. Resolution: six weeks, in which a gear wears.
const TREND_DAYS: i64 = 42;
/// Maximum age of a record; the clock of an older or a future record is treated as wrong \[ns\].
/// Resolution: a fleet host may be away for the longest holidays.
const LATEST_NS: i64 = 30 * DAY_NS;

/// Writer of the cells' events to the store.
#[derive(Debug)]
pub struct Keeper {
    store: Store,
    normals: BTreeMap<String, Normal>,
    minute: i64,
    hour: i64,
    aging: Aging,
}

/// Send and receive time of a record \[ns since the epoch\].
#[derive(Debug, Clone, Copy)]
struct Came {
    told_ns: i64,
    now_ns: i64,
}

/// Action of a user on the page.
#[derive(Debug)]
pub enum Deed {
    /// The open incidents of a cell were acknowledged.
    Acknowledged {
        /// The cell.
        cell: String,
        /// The user.
        by: String,
    },
    /// A note was written.
    Noted {
        /// The cell.
        cell: String,
        /// Text and user.
        note: Note,
    },
    /// A cell has written a label to its archive.
    Labelled {
        /// The cell.
        cell: String,
        /// Text and user.
        label: Label,
    },
}

/// Normal residual of a cell, and its residual by day relative to that.
#[derive(Debug, Default)]
struct Normal {
    joints: Vec<JointNormal>,
    trend: Vec<f64>,
}

impl Keeper {
    /// Creates a keeper that writes to `store`.
    pub fn new(store: Store) -> Self {
        Self {
            store,
            normals: BTreeMap::new(),
            minute: 0,
            hour: 0,
            aging: Aging::default(),
        }
    }

    /// Returns the store.
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// Returns the cells of earlier runs of this host.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn remembered(&self) -> Result<Vec<Remembered>, StoreError> {
        self.store.cells()
    }

    /// Stores an effect of the wall at `now_ns`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn keep(&mut self, wall: &Wall, effect: &Effect, now_ns: i64) -> Result<(), StoreError> {
        match effect {
            Effect::Changed { cell, now, before } => self.changed(cell, *before, *now, now_ns),
            Effect::Missing { cell, now } => {
                let mut news = silence(cell, *now, now_ns);
                news.words += "; it was lost before this fleet host started";
                if self.store.revise(&news)? {
                    return Ok(());
                }
                self.store.raise(&news)
            }
            Effect::Recorded {
                cell,
                instance,
                number,
                told_ns,
                record,
            } => {
                let status = wall.status_of(cell);
                let late_ns = now_ns.saturating_sub(*told_ns);
                let is_right = (0..LATEST_NS).contains(&late_ns);
                let told_ns = if is_right { *told_ns } else { now_ns };
                // A contact stored without its incident would never be reported again.
                self.store.at_once(|store| {
                    if !store.hear(cell, instance, *number, now_ns)? {
                        // A restarted host queries all records that a cell keeps.
                        return Ok(());
                    }
                    match &**record {
                        Record::Contact(contact) => {
                            let came = Came { told_ns, now_ns };
                            self.contact(cell, instance, contact, came, status)
                        }
                        Record::Change(change) => self.change(cell, change, told_ns, status),
                    }
                })
            }
            Effect::Lost {
                cell,
                stage,
                samples,
            } => {
                self.store.raise(&News {
                    cell: cell.clone(),
                    kind: Kind::Loss,
                    place: stage.clone(),
                    severity: Severity::Notice,
                    words: format!("{samples} samples lost before `{stage}`"),
                    at_ns: now_ns,
                })?;
                // A loss is over when it is reported.
                self.store.close(cell, Kind::Loss, stage, now_ns)
            }
            Effect::AskRecords { .. } | Effect::AskStatus { .. } | Effect::AskClock { .. } => {
                Ok(())
            }
        }
    }

    /// Stores a user's action at `at_ns`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn take(&mut self, deed: &Deed, at_ns: i64) -> Result<(), StoreError> {
        match deed {
            Deed::Acknowledged { cell, by } => self.store.acknowledge(cell, by, at_ns),
            Deed::Labelled { cell, label } => self.store.label(cell, label),
            Deed::Noted { cell, note } => {
                self.store.note(cell, note)?;
                // The note is stored, and the normal residual is read again within the hour.
                let _ = self.learn(std::iter::once(cell.as_str()), at_ns);
                Ok(())
            }
        }
    }

    fn changed(
        &self,
        cell: &str,
        before: State,
        now: State,
        now_ns: i64,
    ) -> Result<(), StoreError> {
        match now {
            State::Ended { .. } => self.store.ended(cell, Some(now_ns))?,
            State::Unknown { .. } => {}
            _ => self.store.ended(cell, None)?,
        }
        match now {
            // A transitional state.
            State::Unknown { why } if why != UnknownWhy::TwoPublishers => Ok(()),
            State::Stale { .. } | State::Unknown { .. } => {
                let news = silence(cell, now, now_ns);
                if matches!(before, State::Stale { .. }) {
                    self.store.revise(&news).map(|_| ())
                } else {
                    self.store.raise(&news)
                }
            }
            _ => {
                if matches!(now, State::Ended { .. }) {
                    self.store.run_ended(cell, now_ns)?;
                }
                self.store.close(cell, Kind::Silence, "", now_ns)
            }
        }
    }

    fn change(
        &self,
        cell: &str,
        change: &ChangeMessage,
        told_ns: i64,
        status: Option<&StatusMessage>,
    ) -> Result<(), StoreError> {
        let unit = status.map_or("", |status| status.effort_unit.as_str());
        self.store.raise(&News {
            cell: cell.to_owned(),
            kind: Kind::Change,
            place: format!("{} {}", change.effect, change.joints.join(" ")),
            severity: Severity::Notice,
            words: words::change(change, unit),
            at_ns: told_ns,
        })
    }

    fn contact(
        &self,
        cell: &str,
        instance: &str,
        contact: &ContactMessage,
        Came { told_ns, now_ns }: Came,
        status: Option<&StatusMessage>,
    ) -> Result<(), StoreError> {
        let host = status.map_or("", |status| status.host.as_str());
        let archive = status.and_then(|status| status.archive.as_deref());
        let said = (self.store).contact(cell, instance, contact, host, archive, now_ns)?;
        let is_newest = self.store.is_newest(cell, instance, contact)?;
        // Contacts within ten minutes share an incident, whose state follows the newest one.
        if said == Said::Nothing || (said == Said::More && !is_newest) {
            return Ok(());
        }
        let mut text = words::contact(contact);
        if let Some(status) = status
            && let Some(change) = status.changes.first()
        {
            text += &format!(" ({})", words::change(change, &status.effort_unit));
        }
        // Contacts within ten minutes are one incident at any link: the link is certain only after the contact.
        let place = contact.detector.clone();
        let news = News {
            cell: cell.to_owned(),
            kind: Kind::Contact,
            place,
            severity: if contact.latched {
                Severity::Critical
            } else {
                Severity::Notice
            },
            words: text,
            at_ns: told_ns,
        };
        if said == Said::New {
            self.store.raise(&news)?;
        } else {
            self.store.revise(&news)?;
        }
        if !is_newest {
            return Ok(());
        }
        if let (Some(_), Some(by)) = (contact.acknowledged_ns, &contact.acknowledged_by) {
            self.store.acknowledge(cell, by, told_ns)?;
        }
        let acknowledged = !contact.latched || contact.acknowledged_ns.is_some();
        if contact.end_ns.is_some() && acknowledged {
            self.store
                .close(cell, Kind::Contact, &news.place, told_ns)?;
        }
        Ok(())
    }

    /// Does the periodic work: stores minutes, and once an hour updates the normal residuals.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn tick(&mut self, snapshot: &Snapshot) -> Result<(), StoreError> {
        let now_ns = snapshot.now_ns;
        let (minute, hour) = (now_ns / MINUTE_NS, now_ns / HOUR_NS);
        if minute != self.minute {
            // The first minute is incomplete.
            let first = self.minute == 0;
            self.minute = minute;
            if !first {
                self.store.at_once(|store| minutes(store, snapshot))?;
            }
        }
        if hour != self.hour {
            self.hour = hour;
            self.aging.prune(&self.store, now_ns)?;
            self.learn(snapshot.cells.iter().map(|cell| cell.cell.as_str()), now_ns)?;
        }
        Ok(())
    }

    /// Reads the normal residuals of these cells again.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn learn<'a>(
        &mut self,
        cells: impl Iterator<Item = &'a str>,
        now_ns: i64,
    ) -> Result<(), StoreError> {
        for cell in cells {
            let joints = self.store.normals(cell)?;
            let mut by_day: BTreeMap<i64, (f64, f64)> = BTreeMap::new();
            for day in self.store.days(cell, now_ns - TREND_DAYS * DAY_NS)? {
                let normal = joints.iter().find(|normal| normal.joint == day.joint);
                if let Some(normal) = normal {
                    let sums = by_day.entry(day.day_ns).or_default();
                    sums.0 += day.rms * day.rms;
                    sums.1 += normal.rms * normal.rms;
                }
            }
            let ratios = by_day.values().filter(|(_, normal)| *normal > 0.0);
            let trend = ratios.map(|(now, normal)| (now / normal).sqrt()).collect();
            self.normals
                .insert(cell.to_owned(), Normal { joints, trend });
        }
        Ok(())
    }

    /// Adds the normal residuals of the cells to a snapshot.
    pub fn compare(&self, snapshot: &mut Snapshot) {
        for view in &mut snapshot.cells {
            let Some(normal) = self.normals.get(&view.cell) else {
                continue;
            };
            view.trend.clone_from(&normal.trend);
            let residual = view
                .status
                .as_ref()
                .and_then(|status| status.residual.as_ref());
            let joints = residual.iter().flat_map(|residual| &residual.joints);
            let known = joints.filter_map(|joint| {
                let normal = normal
                    .joints
                    .iter()
                    .find(|normal| normal.joint == joint.name)?;
                Some((joint.name.as_str(), joint.rms, normal.rms))
            });
            if let Some(against) = ResidualView::against(known, "history") {
                view.residual = Some(against);
            }
        }
    }
}

fn silence(cell: &str, now: State, now_ns: i64) -> News {
    News {
        cell: cell.to_owned(),
        kind: Kind::Silence,
        place: String::new(),
        severity: now.severity(),
        words: format!("{}: {}", now.words(), now.reason()),
        at_ns: now_ns,
    }
}

fn minutes(store: &Store, snapshot: &Snapshot) -> Result<(), StoreError> {
    for view in &snapshot.cells {
        let Some(status) = &view.status else { continue };
        let is_there = !matches!(view.state, State::Stale { .. } | State::Ended { .. });
        if is_there {
            store.seen(&view.cell, snapshot.now_ns, &status.host, &status.robot)?;
        }
        let is_fresh = matches!(
            view.state,
            State::Running | State::Contact | State::Muted { .. } | State::Stopped { .. }
        );
        let Some(residual) = status.residual.as_ref().filter(|_| is_fresh) else {
            continue;
        };
        for joint in &residual.joints {
            store.minute(
                &view.cell,
                &joint.name,
                snapshot.now_ns,
                joint.rms,
                joint.mean,
            )?;
        }
    }
    Ok(())
}
