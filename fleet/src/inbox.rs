//! Validation of messages from the bus, which are untrusted: a message that is too long, not finite or malformed is
//! rejected with the reason.
//!
//! Texts, lists and numbers of accepted messages are bounded. No input causes a panic.

use serde::de::DeserializeOwned;
use tauscope_bus::clock::RoundTrip;
use tauscope_publish::message::{
    AlarmMessage, ChangeMessage, ClockMessage, ContactMessage, HealthMessage, Record,
    RecordMessage, ResidualMessage, STATUS_VERSION, StatusMessage,
};

use crate::wall::Event;

/// Maximum size of a status \[bytes\].
/// Resolution: ten times the 4 kB of a status with 16 joints and a dozen stages.
pub const MAX_STATUS_BYTES: usize = 64 * 1024;
/// Maximum size of an answer with the 256 records that a publisher keeps \[bytes\].
/// Resolution: 1 kB each and some.
pub const MAX_RECORDS_BYTES: usize = 512 * 1024;
/// Maximum length of a text \[bytes\].
/// Resolution: names in samples have 48 bytes, hashes 64, paths more.
const MAX_TEXT_BYTES: usize = 256;
/// Maximum length of a list.
/// Resolution: a cell has at most 16 joints and a dozen stages.
const MAX_LIST: usize = 64;

/// Reason why a message is rejected, one of a fixed set; messages are counted by reason.
type Refusal = &'static str;

/// Parses the key of a liveliness token. Returns the cell and the publisher instance.
pub fn token(key: &str) -> Option<(String, String)> {
    let (cell, instance) = key.split_once("/@alive/")?;
    let sound = is_cell(cell) && is_text(instance) && !instance.contains('/');
    sound.then(|| (cell.to_owned(), instance.to_owned()))
}

/// Parses a status.
pub fn status(key: &str, payload: &[u8]) -> Event {
    let event = |(cell, status)| Event::Status { cell, status };
    status_of(key, payload).map_or_else(Event::Refused, event)
}

/// Parses the answer to a status query.
pub fn answer(key: &str, payload: &[u8]) -> Event {
    let event = |(cell, status)| Event::Answer { cell, status };
    status_of(key, payload).map_or_else(Event::Refused, event)
}

fn status_of(key: &str, payload: &[u8]) -> Result<(String, Box<StatusMessage>), Refusal> {
    let cell = cell_of(key, "/status")?;
    let status: StatusMessage = read(payload, MAX_STATUS_BYTES)?;
    check_status(&status)?;
    Ok((cell, Box::new(status)))
}

/// Parses the answer to a clock query, given the times of the query and of the answer \[ns since the epoch\]. A cell
/// that does not know the query answers with its status, for which this returns `None`.
pub fn clock(key: &str, payload: &[u8], asked_ns: i64, back_ns: i64) -> Option<Event> {
    let event = |cell: String| {
        let clock: ClockMessage = read(payload, MAX_STATUS_BYTES)?;
        all_text(std::iter::once(&clock.instance))?;
        let trip = RoundTrip {
            asked_ns,
            received_ns: clock.received_ns,
            answered_ns: clock.answered_ns,
            back_ns,
        };
        let offset = trip.offset().ok_or("times that cannot be")?;
        let instance = clock.instance;
        Ok(Event::Clock {
            cell,
            instance,
            offset,
        })
    };
    let of_status = || read::<StatusMessage>(payload, MAX_STATUS_BYTES).is_ok();
    match cell_of(key, "/status").and_then(event) {
        Ok(event) => Some(event),
        Err(_) if of_status() => None,
        Err(reason) => Some(Event::Refused(reason)),
    }
}

/// Parses a record.
pub fn record(key: &str, payload: &[u8]) -> Event {
    let event = |cell: String| {
        let record: RecordMessage = read(payload, MAX_STATUS_BYTES)?;
        check_record(&record)?;
        let record = Box::new(record);
        Ok(Event::Record { cell, record })
    };
    cell_of(key, "/records")
        .and_then(event)
        .unwrap_or_else(Event::Refused)
}

/// Parses the answer to a query for missing records.
pub fn records(key: &str, payload: &[u8]) -> Vec<Event> {
    let cell = match cell_of(key, "/records") {
        Ok(cell) => cell,
        Err(reason) => return vec![Event::Refused(reason)],
    };
    let records: Vec<RecordMessage> = match read(payload, MAX_RECORDS_BYTES) {
        Ok(records) => records,
        Err(reason) => return vec![Event::Refused(reason)],
    };
    let event = |record: RecordMessage| match check_record(&record) {
        Ok(()) => Event::Record {
            cell: cell.clone(),
            record: Box::new(record),
        },
        Err(reason) => Event::Refused(reason),
    };
    let last = records.iter().max_by_key(|record| record.number);
    let all = last.map(|last| Event::AllRecords {
        cell: cell.clone(),
        instance: last.instance.clone(),
        number: last.number,
    });
    records.into_iter().map(event).chain(all).collect()
}

fn cell_of(key: &str, topic: &str) -> Result<String, Refusal> {
    let cell = key.strip_suffix(topic).filter(|cell| is_cell(cell));
    cell.map(str::to_owned).ok_or("name of a cell that is none")
}

/// Returns whether `name` is a valid cell name, as in pipeline files.
pub fn is_cell(name: &str) -> bool {
    let sound = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    !name.is_empty() && name.len() <= 64 && name.chars().all(sound)
}

fn read<T: DeserializeOwned>(payload: &[u8], most: usize) -> Result<T, Refusal> {
    if payload.len() > most {
        return Err("too long");
    }
    serde_json::from_slice(payload).map_err(|_| "not the message of its topic")
}

fn check_status(status: &StatusMessage) -> Result<(), Refusal> {
    if status.version != STATUS_VERSION {
        return Err("version of the message that is not known");
    }
    let texts = [
        Some(&status.instance),
        Some(&status.host),
        Some(&status.tauscope),
        Some(&status.robot),
        Some(&status.effort_unit),
        status.urdf_sha256.as_ref(),
        status.twin_sha256.as_ref(),
        status.archive.as_ref(),
    ];
    all_text(texts.into_iter().flatten())?;
    check_alarm(&status.alarm)?;
    status.last_contact.as_ref().map_or(Ok(()), check_contact)?;
    short(status.stages.len())?;
    let stages = status
        .stages
        .iter()
        .map(|HealthMessage { stage, .. }| stage);
    all_text(stages)?;
    status.residual.as_ref().map_or(Ok(()), check_residual)?;
    short(status.changes.len())?;
    status.changes.iter().try_for_each(check_change)
}

fn check_record(record: &RecordMessage) -> Result<(), Refusal> {
    all_text([&record.instance])?;
    match &record.record {
        Record::Contact(contact) => check_contact(contact),
        Record::Change(change) => check_change(change),
    }
}

fn check_alarm(alarm: &AlarmMessage) -> Result<(), Refusal> {
    all_text(&alarm.link)?;
    all_finite(alarm.force_n.iter().flatten().chain([&alarm.muted_s]))
}

fn check_contact(contact: &ContactMessage) -> Result<(), Refusal> {
    all_text([&contact.detector, &contact.kind])?;
    let links = contact.link.iter().chain(&contact.other_link);
    all_text(links.chain(&contact.acknowledged_by))?;
    all_finite(&contact.peak_force_n)
}

fn check_change(change: &ChangeMessage) -> Result<(), Refusal> {
    short(change.joints.len())?;
    all_text(
        change
            .joints
            .iter()
            .chain(&change.link)
            .chain([&change.effect]),
    )?;
    all_finite([&change.size])
}

fn check_residual(residual: &ResidualMessage) -> Result<(), Refusal> {
    short(residual.joints.len())?;
    all_text(residual.joints.iter().map(|joint| &joint.name))?;
    let numbers = residual.joints.iter();
    all_finite(numbers.flat_map(|joint| {
        [&joint.rms, &joint.mean]
            .into_iter()
            .chain(&joint.calibrated)
    }))?;
    all_finite([&residual.window_s])
}

fn short(length: usize) -> Result<(), Refusal> {
    (length <= MAX_LIST).then_some(()).ok_or("list too long")
}

fn all_text<'a>(texts: impl IntoIterator<Item = &'a String>) -> Result<(), Refusal> {
    let all = texts
        .into_iter()
        .all(|text| text.is_empty() || is_text(text));
    all.then_some(())
        .ok_or("text too long, or with control characters")
}

fn is_text(text: &str) -> bool {
    !text.is_empty() && text.len() <= MAX_TEXT_BYTES && !text.chars().any(char::is_control)
}

fn all_finite<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> Result<(), Refusal> {
    // Values far beyond any robot would corrupt sums.
    let sound = |number: &&f64| number.is_finite() && number.abs() < 1e12;
    let all = numbers.into_iter().all(|number| sound(&number));
    all.then_some(()).ok_or("number beyond reason")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    fn refused(event: Event) -> Refusal {
        match event {
            Event::Refused(reason) => reason,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_status_is_read_back_as_it_was_told() {
        let told = fixture::status("a1", 5);
        let text = serde_json::to_vec(&told).unwrap();
        let event = status("cell-1/status", &text);
        let expected = Event::Status {
            cell: "cell-1".to_owned(),
            status: Box::new(told),
        };
        assert_eq!(event, expected);
    }

    #[test]
    fn what_is_too_much_or_none_is_refused_with_the_reason() {
        let with = |change: &dyn Fn(&mut StatusMessage)| {
            let mut told = fixture::status("a1", 5);
            change(&mut told);
            refused(status("c/status", &serde_json::to_vec(&told).unwrap()))
        };
        assert_eq!(
            with(&|s| s.version = 2),
            "version of the message that is not known"
        );
        assert_eq!(
            with(&|s| s.host = "x".repeat(300)),
            "text too long, or with control characters"
        );
        assert_eq!(
            with(&|s| s.robot = "a\u{1b}[2J".to_owned()),
            "text too long, or with control characters"
        );
        assert_eq!(with(&|s| s.alarm.muted_s = 1e300), "number beyond reason");
        assert_eq!(
            with(&|s| s.changes = vec![fixture::change(); 65]),
            "list too long"
        );
        assert_eq!(
            refused(status("c/status", &vec![b' '; MAX_STATUS_BYTES + 1])),
            "too long"
        );
        assert_eq!(
            refused(status("c/status", b"[[[[")),
            "not the message of its topic"
        );
        let deep = "[".repeat(60_000);
        assert_eq!(
            refused(status("c/status", deep.as_bytes())),
            "not the message of its topic"
        );
        assert_eq!(
            refused(status("a/b/status", b"{}")),
            "name of a cell that is none"
        );
        assert_eq!(
            refused(status("<b>/status", b"{}")),
            "name of a cell that is none"
        );
    }

    #[test]
    fn a_clock_is_measured_by_an_answer_and_not_by_what_cannot_be() {
        let answer = |received_ns: i64, answered_ns: i64| {
            let message = ClockMessage {
                instance: "a1".to_owned(),
                received_ns,
                answered_ns,
            };
            let text = serde_json::to_vec(&message).unwrap();
            clock("c/status", &text, 1_000, 1_020).unwrap()
        };
        let Event::Clock { offset, .. } = answer(5_010, 5_010) else {
            panic!();
        };
        assert_eq!((offset.ahead_ns, offset.uncertainty_ns), (4_000, 10));
        assert_eq!(refused(answer(5_010, 5_000)), "times that cannot be");
        assert_eq!(refused(answer(0, i64::MAX)), "times that cannot be");
        // A cell of an older version does not know this query.
        let status = serde_json::to_vec(&fixture::status("a1", 5)).unwrap();
        assert_eq!(clock("c/status", &status, 0, 1), None);
        let none = clock("c/status", b"{}", 0, 1).unwrap();
        assert_eq!(refused(none), "not the message of its topic");
    }

    #[test]
    fn a_token_names_a_cell_and_a_life() {
        let named = |key| token(key).map(|(cell, life)| format!("{cell} {life}"));
        assert_eq!(named("c1/@alive/ab12").as_deref(), Some("c1 ab12"));
        for key in [
            "c1/@alive/",
            "a/b/@alive/x",
            "/@alive/x",
            "c1/alive/x",
            "c1/@alive/a/b",
        ] {
            assert_eq!(named(key), None, "{key}");
        }
    }
}
