//! Publishers of many cells in one process, each with a session of its own, fed with synthetic samples: for a trial
//! of a router and a fleet host (`tests/faults/thousand_cells.py`).
//!
//!     many_cells ENDPOINT PREFIX CELLS RATE_HZ SECONDS
//!
//! The cells are `PREFIX0`, `PREFIX1` and so on; every tenth is touched once a minute. They publish only status and
//! contacts. At the end one line of JSON has the number of samples fed, the number of messages that could not be
//! sent, the largest delay of a sample, and the number of contacts of each cell.

use std::collections::BTreeMap;
use std::error::Error;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use tauscope_bus::{Detection, Health, JointState, SampleKind, SampleRef, Sink as _, flags};
use tauscope_publish::{Config, Facts, Publisher, Setup, StreamInfo, ZenohConfig};

/// One cell in this many is touched; the other constants are the period, the first time and the duration.
const TOUCHED_EVERY: usize = 10;
const TOUCH_EVERY_S: u64 = 60;
const TOUCH_AFTER_S: u64 = 15;
const TOUCH_S: f64 = 0.8;
/// Number of threads that feed the publishers, each a part of the cells.
const THREADS: usize = 2;

type Failure = Box<dyn Error + Send + Sync>;

struct Cell {
    name: String,
    publisher: Publisher,
    is_touched: bool,
    was_touched: bool,
    contacts: u64,
}

impl Cell {
    fn open(name: String, number: usize, endpoint: &str) -> Result<Self, Failure> {
        let config = Config {
            zenoh: Some(ZenohConfig {
                connect: vec![endpoint.to_owned()],
                json: false,
                ..ZenohConfig::default()
            }),
            stop_after_s: 5.0,
            ..Config::default()
        };
        let stream = |stage: &str, kind, judges_contact: bool| StreamInfo {
            stage: stage.to_owned(),
            kind,
            detector: judges_contact.then(|| "made_up".to_owned()),
            judges_contact,
        };
        let setup = Setup {
            cell: name.clone(),
            joint_names: (1..=7).map(|joint| format!("joint_{joint}")).collect(),
            model: None,
            streams: vec![
                stream("ingest", SampleKind::JointState, false),
                stream("detect", SampleKind::Detection, true),
            ],
            commands: None,
            facts: Facts {
                effort_unit: "Nm".to_owned(),
                ..Facts::default()
            },
            restarted: false,
        };
        Ok(Self {
            publisher: Publisher::new(&config, &setup)?,
            name,
            is_touched: number.is_multiple_of(TOUCHED_EVERY),
            was_touched: false,
            contacts: 0,
        })
    }

    /// Feeds sample `number` to the publisher.
    fn tell(&mut self, number: u64, rate_hz: u64) -> Result<(), Failure> {
        let mut state = JointState::default();
        state.header.stamp_ns = now_ns();
        state.header.received_ns = state.header.stamp_ns;
        state.header.sequence = number;
        state.header.joint_count = 7;
        self.publisher
            .accept("ingest", SampleRef::JointState(&state))?;
        let into_s = (number % (TOUCH_EVERY_S * rate_hz)) as f64 / rate_hz as f64;
        let into_s = into_s - TOUCH_AFTER_S as f64;
        let touched = self.is_touched && (0.0..TOUCH_S).contains(&into_s);
        let mut detection = Detection {
            header: state.header,
            detector: "made_up".into(),
            state: if touched { "contact" } else { "free" }.into(),
            score: f64::from(u8::from(touched)),
            threshold: 0.5,
            contact_ns: state.header.stamp_ns,
            ..Detection::default()
        };
        detection.header.flags = flags::READY | if touched { flags::ALARM } else { 0 };
        detection.event = match (self.was_touched, touched) {
            (false, true) => Detection::ONSET,
            (true, false) => Detection::OFFSET,
            _ => 0,
        };
        self.contacts += u64::from(!self.was_touched && touched);
        self.was_touched = touched;
        self.publisher
            .accept("detect", SampleRef::Detection(&detection))?;
        if number.is_multiple_of(rate_hz) {
            let health = Health {
                header: state.header,
                stage: "detect".into(),
                received: number,
                emitted: number,
                ..Health::default()
            };
            self.publisher
                .accept("detect", SampleRef::Health(&health))?;
        }
        Ok(())
    }
}

fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| {
        i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
    })
}

/// Feeds all samples to a part of the cells when they are due; returns the largest delay.
fn play(cells: &mut [Cell], rate_hz: u64, seconds: u64) -> Result<Duration, Failure> {
    let begin = Instant::now();
    let mut latest = Duration::ZERO;
    for number in 0..seconds * rate_hz {
        let due = begin + Duration::from_nanos(number * 1_000_000_000 / rate_hz);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        for cell in &mut *cells {
            cell.tell(number, rate_hz)?;
        }
        latest = latest.max(due.elapsed());
    }
    for cell in cells {
        cell.publisher.finish()?;
    }
    Ok(latest)
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [endpoint, prefix, count, rate_hz, seconds] = arguments.as_slice() else {
        return Err("many_cells ENDPOINT PREFIX CELLS RATE_HZ SECONDS".into());
    };
    let (count, rate_hz, seconds): (usize, u64, u64) =
        (count.parse()?, rate_hz.parse()?, seconds.parse()?);
    let open = |number| Cell::open(format!("{prefix}{number}"), number, endpoint);
    let mut cells = (0..count).map(open).collect::<Result<Vec<_>, _>>()?;
    let share = cells.len().div_ceil(THREADS).max(1);
    let latest = std::thread::scope(|scope| {
        let shares = cells.chunks_mut(share);
        let threads: Vec<_> = shares
            .map(|cells| scope.spawn(move || play(cells, rate_hz, seconds)))
            .collect();
        let ended = threads.into_iter().map(|thread| {
            let played = thread.join();
            played.map_err(|_| Failure::from("a thread panicked"))?
        });
        ended.collect::<Result<Vec<_>, _>>()
    })?;
    // The last messages are still in transit.
    std::thread::sleep(Duration::from_secs(2));
    let contacts: BTreeMap<&str, u64> = cells
        .iter()
        .map(|cell| (cell.name.as_str(), cell.contacts))
        .collect();
    let said = serde_json::json!({
        "told": count as u64 * rate_hz * seconds,
        "unsent": cells.iter().map(|cell| cell.publisher.dropped()).sum::<u64>(),
        "late_ms": latest.iter().max().map(|late| late.as_millis() as u64),
        "contacts": contacts,
    });
    println!("{said}");
    Ok(())
}
