//! State of one cell.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use tauscope_bus::clock::Offset;
use tauscope_publish::message::{AlarmState, RecordMessage, StatusMessage};

use super::latch::Latch;
use super::life::Life;
use super::snapshot::{CellView, ResidualView};
use super::state::{Severity, StaleWhy, State, UnknownWhy};
use super::{CLOCK_LIMIT_NS, Effect, Now, PARTING_MS, STALE_AFTER_MS};

/// Maximum number of publisher instances tracked for a cell.
/// Resolution: one is right, two are a fault; an unknown publisher must not fill the memory.
const MAX_LIVES: usize = 8;
/// Number of minutes of the residual that are kept. Resolution: an hour on the small curve of a tile.
const MINUTES: usize = 60;
const NS_PER_MS: i64 = 1_000_000;

/// A cell of an earlier run of the fleet host.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Remembered {
    /// Its name.
    pub cell: String,
    /// Time when it was last seen \[ns since the epoch\].
    pub seen_ns: i64,
    /// Time of the normal end of its run, if nothing was received after that \[ns since the epoch\].
    pub ended_ns: Option<i64>,
}

/// A monitored cell.
#[derive(Debug, Default)]
pub struct Watched {
    /// Whether it was named at the start.
    pub expected: bool,
    /// State from an earlier run of the fleet host.
    remembered: Option<Remembered>,
    /// Publisher instances with a token.
    lives: BTreeSet<String>,
    /// Publisher instances that have sent a status; at most one more than [`MAX_LIVES`].
    heard: BTreeMap<String, Life>,
    /// Time when its last token was lost.
    gone: Option<Now>,
    status: Option<(StatusMessage, Now)>,
    latch: Latch,
    minutes: VecDeque<f64>,
    minute: Option<i64>,
    /// The state at the last update, and its start if this host observed it \[ns since the epoch\].
    settled: Option<(State, Option<i64>)>,
}

impl Watched {
    /// Restores the state from an earlier run of the fleet host. `latched`: the publisher instance that was latched,
    /// and the start of the latch \[ns since the epoch\].
    pub fn remember(&mut self, known: Remembered, latched: Option<(String, i64)>) {
        self.remembered = Some(known);
        self.latch.remember(latched);
    }

    /// Adds a token. Returns `false` if there are too many.
    pub fn alive(&mut self, instance: String) -> bool {
        if self.lives.len() >= MAX_LIVES && !self.lives.contains(&instance) {
            return false;
        }
        self.lives.insert(instance);
        self.gone = None;
        true
    }

    /// Returns whether it is connected and the status of that publisher instance is unknown.
    pub fn awaits_status(&self) -> bool {
        let known = self.newest().map(|status| &status.instance);
        known.is_none_or(|known| !self.lives.contains(known))
    }

    /// Removes a token.
    pub fn gone(&mut self, instance: &str, now: Now) {
        if self.lives.remove(instance) && self.lives.is_empty() {
            self.gone = Some(now);
        }
    }

    /// Returns the newest status.
    pub fn newest(&self) -> Option<&StatusMessage> {
        self.status.as_ref().map(|(status, _)| status)
    }

    /// Processes the answer to a status query. A periodic status that arrived meanwhile is newer.
    pub fn answer(
        &mut self,
        name: &str,
        status: StatusMessage,
        now: Now,
        effects: &mut Vec<Effect>,
    ) {
        let known = self.newest().map(|known| known.instance.as_str());
        if known != Some(status.instance.as_str()) {
            self.status(name, status, now, effects);
        }
    }

    /// Processes a status. Statuses arrive in the order of sending, so stamps are ignored: the cell's clock may have
    /// been set back.
    pub fn status(
        &mut self,
        name: &str,
        status: StatusMessage,
        now: Now,
        effects: &mut Vec<Effect>,
    ) {
        let lives = &self.lives;
        let is_ours = |life: &String| lives.contains(life);
        let known = self.newest().map(|known| &known.instance);
        let is_same = known.is_some_and(|known| *known == status.instance);
        // Another publisher sends: the one with a token takes precedence.
        if !is_same && known.is_some_and(is_ours) && !is_ours(&status.instance) {
            return;
        }
        if self.heard.len() >= MAX_LIVES && !self.heard.contains_key(&status.instance) {
            self.heard.retain(|life, _| lives.contains(life));
        }
        let life = self.heard.entry(status.instance.clone()).or_default();
        life.take(name, &status, now, effects);
        self.note_residual(&status);
        self.latch
            .take(&status.alarm, &status.instance, now.unix_ns);
        self.status = Some((status, now));
    }

    /// Stores one value per minute, for the curve.
    fn note_residual(&mut self, status: &StatusMessage) {
        let Some(residual) = &status.residual else {
            return;
        };
        let minute = residual.stamp_ns / 60_000_000_000;
        if self.minute == Some(minute) || residual.joints.is_empty() {
            return;
        }
        self.minute = Some(minute);
        let squares = residual.joints.iter().map(|joint| joint.rms * joint.rms);
        self.minutes.push_back(squares.sum::<f64>().sqrt());
        if self.minutes.len() > MINUTES {
            self.minutes.pop_front();
        }
    }

    /// Processes a record.
    pub fn record(&mut self, name: &str, message: RecordMessage, effects: &mut Vec<Effect>) {
        if self.status.is_some() && !self.speaks(&message.instance) {
            // The instance has ended, or has not sent its first status yet.
            return;
        }
        // After a gap, the next status causes a query for the missing records.
        if let Some(life) = self.heard.get_mut(&message.instance)
            && message.number == life.records.saturating_add(1)
        {
            life.records = message.number;
        }
        effects.push(Effect::Recorded {
            cell: name.to_owned(),
            instance: message.instance,
            number: message.number,
            told_ns: message.sent_ns,
            record: Box::new(message.record),
        });
    }

    /// Returns whether an instance has sent a status, and is the newest one or has a token.
    fn speaks(&self, instance: &str) -> bool {
        let known = self.newest();
        let is_newest = known.is_some_and(|status| status.instance == instance);
        is_newest || (self.lives.contains(instance) && self.heard.contains_key(instance))
    }

    /// Processes a measurement of its clock.
    pub fn clock(&mut self, instance: &str, offset: Offset, now: Now) {
        if let Some(life) = self.heard.get_mut(instance) {
            life.clock.note(offset, now.running_ms);
        }
    }

    /// Marks the records up to `number` as received: all that the cell keeps have arrived, older ones are lost.
    pub fn all_records(&mut self, instance: &str, number: u64) {
        if !self.speaks(instance) {
            return;
        }
        if let Some(life) = self.heard.get_mut(instance) {
            life.records = life.records.max(number);
        }
    }

    /// Returns its state.
    pub fn state(&self, reached: usize, now: Now) -> State {
        let Some((status, at)) = &self.status else {
            return self.state_without_status();
        };
        let stale = |since_ns, why| State::Stale { since_ns, why };
        if status.ended {
            return State::Ended {
                since_ns: at.unix_ns,
            };
        }
        let age_ms = now.running_ms.saturating_sub(at.running_ms);
        if reached == 0 && (self.gone.is_some() || age_ms > STALE_AFTER_MS) {
            return stale(at.unix_ns, StaleWhy::Connection);
        }
        // The last status of a run that ends normally may arrive shortly after the loss of its token.
        let parts = |gone: &Now| now.running_ms.saturating_sub(gone.running_ms) < PARTING_MS;
        let is_parting = self.gone.as_ref().is_some_and(parts);
        if let Some(gone) = self.gone.filter(|_| !is_parting) {
            // A cell that was silent before the loss of its token is stale since its last status.
            let silent_ms = gone.running_ms.saturating_sub(at.running_ms);
            let was_silent = silent_ms > STALE_AFTER_MS;
            let since = if was_silent { *at } else { gone };
            return stale(since.unix_ns, StaleWhy::Token);
        }
        let unknown = |why| State::Unknown { why };
        if self.lives.len() > 1 {
            return unknown(UnknownWhy::TwoPublishers);
        }
        if age_ms > STALE_AFTER_MS {
            return stale(at.unix_ns, StaleWhy::Status);
        }
        if self.lives.is_empty() && !is_parting {
            return unknown(UnknownWhy::NoToken);
        }
        if !is_parting && !self.lives.contains(&status.instance) {
            return unknown(UnknownWhy::NoStatus);
        }
        let muted_ms = (status.alarm.muted_s * 1e3) as u64;
        let muted = muted_ms
            .checked_sub(age_ms)
            .filter(|left| *left > 0)
            .map(|_| State::Muted {
                until_ns: at.unix_ns.saturating_add(muted_ms as i64 * NS_PER_MS),
            });
        match status.alarm.state {
            AlarmState::Collision => State::Stopped {
                acknowledged: false,
            },
            AlarmState::Acknowledged => State::Stopped { acknowledged: true },
            // Samples arrive, but no detector has evaluated one yet.
            AlarmState::Silent if status.alarm.stamp_ns == 0 => State::NotReady,
            AlarmState::Silent => {
                let age_ns = status
                    .last_sample_age_ms
                    .unwrap_or(0)
                    .saturating_mul(1_000_000);
                let age_ns = i64::try_from(age_ns).unwrap_or(i64::MAX);
                stale(at.unix_ns.saturating_sub(age_ns), StaleWhy::Samples)
            }
            AlarmState::NotReady => State::NotReady,
            AlarmState::Contact => muted.unwrap_or(State::Contact),
            AlarmState::Free => muted.unwrap_or(State::Running),
        }
    }

    fn state_without_status(&self) -> State {
        if !self.lives.is_empty() {
            return State::Unknown {
                why: UnknownWhy::NoStatus,
            };
        }
        let stale = |since_ns| State::Stale {
            since_ns,
            why: StaleWhy::Token,
        };
        match (self.gone, &self.remembered) {
            (Some(gone), _) => stale(gone.unix_ns),
            (None, Some(known)) => known
                .ended_ns
                .map_or(stale(known.seen_ns), |since_ns| State::Ended { since_ns }),
            (None, None) => State::NeverSeen,
        }
    }

    /// Returns the report of a cell that was lost before this run of the fleet host, if it was.
    pub fn missing(&self, name: &str) -> Option<Effect> {
        let (now, _) = self.settled?;
        let is_missing = self.remembered.is_some() && self.status.is_none();
        (is_missing && matches!(now, State::Stale { .. })).then(|| Effect::Missing {
            cell: name.to_owned(),
            now,
        })
    }

    /// Updates the stored state. Returns its change, if any.
    pub fn settle(&mut self, name: &str, reached: usize, now: Now) -> Option<Effect> {
        let state = self.state(reached, now);
        let before = self.settled.map(|(state, _)| state);
        let changed = before.is_none_or(|before| !before.same_as(state));
        if changed {
            // The start of a state is unknown if it precedes the first message that this host received.
            let is_untold = |state| matches!(state, State::Unknown { .. } | State::NeverSeen);
            let began_unseen = before.is_none_or(is_untold) && !is_untold(state);
            self.settled = Some((state, (!began_unseen).then_some(now.unix_ns)));
        }
        let before = before.filter(|_| changed)?;
        Some(Effect::Changed {
            cell: name.to_owned(),
            before,
            now: state,
        })
    }

    /// Returns the view of the cell in a snapshot.
    pub fn view(&self, name: &str, reached: usize, now: Now) -> CellView {
        let state = self.state(reached, now);
        let since_ns = match state {
            State::Stale { since_ns, .. } => Some(since_ns),
            State::Stopped { .. } => self.latch.since_ns(),
            _ => self.settled.and_then(|(_, since_ns)| since_ns),
        };
        let age_ms = |at: &Now| now.running_ms.saturating_sub(at.running_ms);
        let newest = self.newest().map(|status| &status.instance);
        let life = newest.and_then(|instance| self.heard.get(instance));
        let clock = life.and_then(|life| life.clock.best(now.running_ms));
        let ms = |ns: i64| ns as f64 / NS_PER_MS as f64;
        let status_age_ms = self.status.as_ref().map(|(_, at)| age_ms(at));
        let sample_age_ms = self
            .status
            .as_ref()
            .and_then(|(status, at)| Some(status.last_sample_age_ms?.saturating_add(age_ms(at))));
        CellView {
            cell: name.to_owned(),
            state,
            severity: match self.latch.since_ns() {
                Some(_) => Severity::Critical,
                None => state.severity(),
            },
            since_ns,
            latched_since_ns: self.latch.since_ns(),
            status_age_ms,
            sample_age_ms,
            clock_ahead_ms: clock.map(|clock| ms(clock.ahead_ns)),
            clock_uncertainty_ms: clock.map(|clock| ms(clock.uncertainty_ns)),
            clock_is_off: clock.is_some_and(|clock| clock.exceeds(CLOCK_LIMIT_NS)),
            lost_samples: life.map_or(0, Life::lost_samples),
            residual: self.newest().and_then(ResidualView::of),
            curve: self.minutes.iter().copied().collect(),
            trend: Vec::new(),
            drift: None,
            urdf_differs: false,
            status: self.newest().cloned(),
        }
    }
}
