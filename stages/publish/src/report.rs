//! The report of a cell to its fleet: a pure state machine over samples. Time is that of the samples.

mod residual;

use std::collections::BTreeMap;

use tauscope_bus::{Command, ContactFollower, Detection, EventKind, Name, Verb, flags};

use crate::alarm::State;
use crate::message::{ChangeMessage, ContactMessage, HealthMessage, Record};
pub use residual::Residual;

const DAY_NS: i64 = 86_400_000_000_000;
/// Maximum number of stages whose health is kept. Resolution: a cell has fewer than ten.
const MAX_STAGES: usize = 64;

/// Contacts, changes and health of one cell.
#[derive(Debug)]
pub struct Report {
    joints: Vec<String>,
    followers: Vec<ContactFollower>,
    /// The detector of the contact in progress.
    open: Option<usize>,
    last: Option<ContactMessage>,
    contacts: u64,
    today: u64,
    today_since_ns: i64,
    changes: BTreeMap<usize, ChangeMessage>,
    health: BTreeMap<String, HealthMessage>,
    /// Records that are not sent yet.
    news: Vec<Record>,
}

impl Report {
    /// Creates the report of a cell with these joints and this number of detection streams.
    pub fn new(joints: Vec<String>, detectors: usize) -> Self {
        Self {
            joints,
            followers: vec![ContactFollower::default(); detectors],
            open: None,
            last: None,
            contacts: 0,
            today: 0,
            today_since_ns: 0,
            changes: BTreeMap::new(),
            health: BTreeMap::new(),
            news: Vec::new(),
        }
    }

    /// Returns the newest contact.
    pub fn last(&self) -> Option<&ContactMessage> {
        self.last.as_ref()
    }

    /// Returns the number of contacts since midnight (UTC) or the first sample, and that time \[ns since the epoch\].
    pub fn today(&self) -> (u64, i64) {
        (self.today, self.today_since_ns)
    }

    /// Returns the changes that are reported now.
    pub fn changes(&self) -> Vec<ChangeMessage> {
        self.changes.values().cloned().collect()
    }

    /// Returns the newest health of each stage.
    pub fn health(&self) -> Vec<HealthMessage> {
        self.health.values().cloned().collect()
    }

    /// Removes and returns the records that are not sent yet.
    pub fn news(&mut self) -> Vec<Record> {
        std::mem::take(&mut self.news)
    }

    /// Takes the health of a stage.
    pub fn take_health(&mut self, health: HealthMessage) {
        if self.health.len() < MAX_STAGES || self.health.contains_key(&health.stage) {
            self.health.insert(health.stage.clone(), health);
        }
    }

    /// Takes a detection of detector number `at`, called `label`. `judges`: whether it reports contacts. `alarm`: the
    /// current state of the alarm.
    pub fn detection(
        &mut self,
        at: usize,
        label: &str,
        detection: &Detection,
        judges: bool,
        alarm: State,
    ) {
        self.turn_day(detection.header.stamp_ns);
        if detection.header.has(flags::CHANGE) || self.changes.contains_key(&at) {
            self.change(at, detection);
        }
        let Some(follower) = self.followers.get_mut(at).filter(|_| judges) else {
            return;
        };
        let is_contact = !detection.header.has(flags::CHANGE);
        let ended = follower.push(detection);
        if let (Some(contact), true) = (ended, self.open == Some(at)) {
            self.open = None;
            self.revise(&contact, Some(contact.end_ns));
        }
        if detection.event() == EventKind::Onset && self.open.is_none() && is_contact {
            self.begin(at, label, detection);
        }
        let latches = self.open.is_some() && alarm == State::Collision;
        if let Some(last) = self.last.as_mut().filter(|last| latches && !last.latched) {
            last.latched = true;
            let told = last.clone();
            self.news.push(Record::Contact(told));
        }
    }

    fn begin(&mut self, at: usize, label: &str, detection: &Detection) {
        let Some(contact) = self.followers[at].open().copied() else {
            return;
        };
        self.open = Some(at);
        self.contacts += 1;
        self.today += 1;
        self.last = Some(ContactMessage {
            number: self.contacts,
            detector: label.to_owned(),
            kind: String::new(),
            link: None,
            other_link: None,
            begin_ns: detection.contact_ns,
            onset_ns: detection.header.stamp_ns,
            end_ns: None,
            peak_force_n: None,
            latched: false,
            acknowledged_ns: None,
            acknowledged_by: None,
        });
        self.revise(&contact, None);
    }

    /// Updates the newest contact and adds a record of it.
    fn revise(&mut self, contact: &tauscope_bus::Contact, end_ns: Option<i64>) {
        let Some(last) = &mut self.last else { return };
        let told = |link: &Name| Some(link.to_string()).filter(|link| !link.is_empty());
        last.kind = contact.kind.to_string();
        last.link = told(&contact.link);
        last.other_link = told(&contact.other_link);
        last.peak_force_n = contact.peak().map(tauscope_bus::Force::norm_n);
        last.end_ns = end_ns;
        let told = last.clone();
        self.news.push(Record::Contact(told));
    }

    fn change(&mut self, at: usize, detection: &Detection) {
        if !(detection.alarm() && detection.header.has(flags::CHANGE)) {
            self.changes.remove(&at);
            return;
        }
        if detection.event() != EventKind::Onset && self.changes.contains_key(&at) {
            return;
        }
        let link = detection.link.as_str();
        let named = self.joints.iter().enumerate();
        let change = ChangeMessage {
            effect: detection.state.to_string(),
            link: (!link.is_empty()).then(|| link.to_owned()),
            joints: named
                .filter(|(place, _)| detection.joints >> place & 1 == 1)
                .map(|(_, name)| name.clone())
                .collect(),
            size: detection.size,
            since_ns: detection.contact_ns,
        };
        self.changes.insert(at, change.clone());
        self.news.push(Record::Change(change));
    }

    /// Takes a command that is in effect from `stamp_ns` on.
    pub fn command(&mut self, stamp_ns: i64, command: &Command) {
        let acknowledges = command.verb() == Some(Verb::Acknowledge);
        let open = |last: &&mut ContactMessage| last.acknowledged_ns.is_none();
        let Some(last) = self.last.as_mut().filter(|_| acknowledges).filter(open) else {
            return;
        };
        last.acknowledged_ns = Some(stamp_ns);
        last.acknowledged_by = command.by().map(str::to_owned);
        let told = last.clone();
        self.news.push(Record::Contact(told));
    }

    fn turn_day(&mut self, stamp_ns: i64) {
        let midnight_ns = stamp_ns - stamp_ns.rem_euclid(DAY_NS);
        if self.today_since_ns == 0 {
            self.today_since_ns = stamp_ns;
        } else if midnight_ns > self.today_since_ns {
            self.today_since_ns = midnight_ns;
            self.today = 0;
        }
    }
}

#[cfg(test)]
mod tests;
