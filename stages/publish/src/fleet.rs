//! Reports of the cell to its fleet: the status once a second, and each contact as it occurs.

use std::os::unix::process::parent_id;
use std::time::{Duration, Instant};

use tauscope_bus::{Command, Detection, Health, TwinState, flags};
use zenoh::Session;

use crate::alarm::State;
use crate::error::PublishError;
use crate::message::{AlarmMessage, HealthMessage, RecordMessage, STATUS_VERSION, StatusMessage};
use crate::presence::{Presence, now_ns};
use crate::report::{Report, Residual};

/// Period of the status. Resolution: a fleet host calls a cell stale after a few of them.
const PERIOD: Duration = Duration::from_secs(1);

/// Facts about a cell and its files, reported to the fleet.
#[derive(Debug, Clone, Default)]
pub struct Facts {
    /// Unit of the measured effort.
    pub effort_unit: String,
    /// SHA-256 of the URDF.
    pub urdf_sha256: Option<String>,
    /// SHA-256 of the twin's file.
    pub twin_sha256: Option<String>,
    /// Standard deviation of each joint's residual at the twin's calibration \[effort unit\].
    pub calibrated: Vec<Option<f64>>,
    /// Paths to which the cell's recorder writes, with `*` for numbers and times in a name and `, ` between names.
    pub archive: Option<String>,
}

/// The cell's part in a fleet.
pub struct Fleet {
    presence: Presence,
    report: Report,
    residual: Residual,
    /// The last status, from which the next one takes the constant fields.
    status: StatusMessage,
    told: Option<Instant>,
    /// Stamp of the newest sample, and its time of arrival.
    newest: Option<(i64, Instant)>,
    /// Process id of the supervisor. Only a run whose supervisor is alive can have ended normally.
    supervisor: u32,
}

impl Fleet {
    /// Announces the cell.
    ///
    /// # Errors
    /// If Zenoh rejects a key.
    pub fn open(
        session: &Session,
        cell: &str,
        robot: &str,
        joints: &[String],
        detectors: usize,
        facts: Facts,
        takes_commands: bool,
    ) -> Result<Self, PublishError> {
        // The id of the session differs in each process.
        let instance = session.zid().to_string();
        Ok(Self {
            presence: Presence::open(session, cell, &instance)?,
            report: Report::new(joints.to_vec(), detectors),
            residual: Residual::new(joints.to_vec(), facts.calibrated),
            status: StatusMessage {
                version: STATUS_VERSION,
                instance,
                sent_ns: 0,
                host: host(),
                tauscope: env!("CARGO_PKG_VERSION").to_owned(),
                robot: robot.to_owned(),
                effort_unit: facts.effort_unit,
                urdf_sha256: facts.urdf_sha256,
                twin_sha256: facts.twin_sha256,
                archive: facts.archive,
                takes_commands,
                ended: false,
                alarm: AlarmMessage::silent(),
                last_sample_ns: None,
                last_sample_age_ms: None,
                contacts_today: 0,
                contacts_since_ns: 0,
                last_contact: None,
                last_record: 0,
                stages: Vec::new(),
                unsent: 0,
                residual: None,
                changes: Vec::new(),
            },
            told: None,
            newest: None,
            supervisor: parent_id(),
        })
    }

    /// Records the arrival of a sample with this stamp.
    pub fn sample(&mut self, stamp_ns: i64) {
        self.newest = Some((stamp_ns, Instant::now()));
    }

    /// Takes a sample of the twin.
    pub fn twin(&mut self, sample: &TwinState) {
        self.residual.twin(sample);
    }

    /// Takes a command.
    pub fn command(&mut self, stamp_ns: i64, command: &Command) {
        self.report.command(stamp_ns, command);
    }

    /// Takes the health of a stage.
    pub fn health(&mut self, health: &Health) {
        self.report.take_health(HealthMessage::from(health));
    }

    /// Takes a detection of detector number `at`, called `label`. `judges`: whether it reports contacts. `alarm`: the
    /// state of the alarm.
    pub fn detection(
        &mut self,
        at: usize,
        label: &str,
        detection: &Detection,
        judges: bool,
        alarm: State,
    ) {
        if judges && detection.alarm() && !detection.header.has(flags::CHANGE) {
            self.residual.touched(detection.header.stamp_ns);
        }
        self.report.detection(at, label, detection, judges, alarm);
    }

    /// Sends the new records, and the status if it is due, if it changed, or if the run has `ended`.
    ///
    /// # Errors
    /// If a message cannot be sent.
    pub fn tell(
        &mut self,
        now: Instant,
        alarm: &AlarmMessage,
        unsent: u64,
        ended: bool,
    ) -> Result<(), PublishError> {
        let news = self.report.news();
        let has_news = !news.is_empty();
        for record in news {
            self.status.last_record += 1;
            self.presence.record(&RecordMessage {
                instance: self.status.instance.clone(),
                number: self.status.last_record,
                sent_ns: now_ns(),
                record,
            })?;
        }
        let is_due = self
            .told
            .is_none_or(|told| now.saturating_duration_since(told) >= PERIOD);
        let changed = self.status.alarm.state != alarm.state;
        if !(is_due || has_news || ended || changed) {
            return Ok(());
        }
        self.told = Some(now);
        let age = self
            .newest
            .map(|(_, came)| now.saturating_duration_since(came));
        let (contacts_today, contacts_since_ns) = self.report.today();
        self.status = StatusMessage {
            sent_ns: now_ns(),
            ended: ended && parent_id() == self.supervisor && !is_exiting(self.supervisor),
            alarm: alarm.clone(),
            last_sample_ns: self.newest.map(|(stamp_ns, _)| stamp_ns),
            last_sample_age_ms: age.map(|age| u64::try_from(age.as_millis()).unwrap_or(u64::MAX)),
            contacts_today,
            contacts_since_ns,
            last_contact: self.report.last().cloned(),
            stages: self.report.health(),
            unsent,
            residual: self.residual.message(),
            changes: self.report.changes(),
            ..self.status.clone()
        };
        self.presence.status(&self.status)
    }
}

/// Whether a process of this host is ending or has ended; false if the system does not report it. The parent id of
/// its children does not suffice: they notice that it closes its pipes before they get another parent.
fn is_exiting(process: u32) -> bool {
    // Field 9 of the line are the kernel's flags (proc(5)), of which PF_EXITING is this one (linux/sched.h).
    const PF_EXITING: u64 = 0x4;
    let line = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    // The process name in front may contain spaces and brackets.
    let behind = line.rsplit(')').next().unwrap_or_default();
    let flags = behind.split_whitespace().nth(6);
    flags.is_some_and(|flags| {
        flags
            .parse::<u64>()
            .is_ok_and(|flags| flags & PF_EXITING != 0)
    })
}

/// Returns the computer's name; empty if the system does not report it.
fn host() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    name.trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_was_killed_is_seen_to_end_before_anybody_has_waited_for_it() {
        assert!(!is_exiting(std::process::id()));
        let mut child = std::process::Command::new("sleep")
            .arg("60")
            .spawn()
            .unwrap();
        assert!(!is_exiting(child.id()));
        child.kill().unwrap();
        let begin = Instant::now();
        while !is_exiting(child.id()) {
            assert!(begin.elapsed() < Duration::from_mins(1));
            std::thread::sleep(Duration::from_millis(1));
        }
        child.wait().unwrap();
    }
}
