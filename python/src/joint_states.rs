//! Joint states of a recording as one table: one row per message, three columns per joint.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Array, Int64Array, RecordBatch};
use arrow::buffer::NullBuffer;
use arrow::error::ArrowError;
use pyo3::PyErr;
use tauscope_archive::ros::JointState;
use tauscope_archive::{ArchiveError, Recording};

/// Messages between two checks for an interrupt.
const STRIDE: usize = 4096;
/// Suffixes of a joint's name in the names of its columns.
const QUANTITIES: [&str; 3] = ["position", "velocity", "effort"];

/// Reason why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The recording cannot be read.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// The topic is ambiguous or missing; the caller must name one.
    #[error("{path}: {found}; name one with `topic`")]
    Topic {
        /// The recording.
        path: String,
        /// Topics of the recording.
        found: String,
    },
    /// The columns do not fit together.
    #[error(transparent)]
    Arrow(#[from] ArrowError),
    /// The caller interrupted the reading; its own exception.
    #[error(transparent)]
    Stopped(PyErr),
}

impl ReadError {
    /// Number of the wrong line of a table, from 1.
    pub fn line(&self) -> Option<u64> {
        match self {
            Self::Archive(ArchiveError::Csv(error)) => Some(error.line),
            _ => None,
        }
    }
}

/// Joint states of a recording.
pub struct Read {
    /// `stamp_ns`, then three columns per joint.
    pub batch: RecordBatch,
    /// Topic of the joint states.
    pub topic: String,
    /// One sentence per loss.
    pub lost: Vec<String>,
}

/// Values of one column; null in a message without it.
#[derive(Default)]
struct Column {
    values: Vec<f64>,
    valid: Vec<bool>,
}

impl Column {
    /// Writes the value of message number `row`, from 0. If a joint is named twice, the first value is kept.
    fn put(&mut self, row: usize, value: f64) {
        if self.values.len() <= row {
            self.fill(row);
            self.values.push(value);
            self.valid.push(true);
        }
    }

    fn fill(&mut self, rows: usize) {
        self.values.resize(rows, 0.0);
        self.valid.resize(rows, false);
    }

    fn array(mut self, rows: usize) -> ArrayRef {
        self.fill(rows);
        let nulls = self.valid.contains(&false);
        let nulls = nulls.then(|| NullBuffer::from(self.valid));
        Arc::new(Float64Array::new(self.values.into(), nulls))
    }
}

/// Columns under construction.
#[derive(Default)]
struct Columns {
    stamps_ns: Vec<i64>,
    /// In the order of their first appearance.
    joints: Vec<(String, [Column; 3])>,
    places: HashMap<String, usize>,
}

impl Columns {
    fn take(&mut self, state: &JointState) {
        let row = self.stamps_ns.len();
        self.stamps_ns.push(state.header.stamp.ns());
        let quantities = [&state.position, &state.velocity, &state.effort];
        for (index, name) in state.name.iter().enumerate() {
            let place = self.places.get(name).copied().unwrap_or_else(|| {
                self.joints.push((name.clone(), Default::default()));
                self.places.insert(name.clone(), self.joints.len() - 1);
                self.joints.len() - 1
            });
            for (column, values) in self.joints[place].1.iter_mut().zip(quantities) {
                if let Some(&value) = values.get(index) {
                    column.put(row, value);
                }
            }
        }
    }

    fn batch(self) -> Result<RecordBatch, ArrowError> {
        let rows = self.stamps_ns.len();
        let stamps: ArrayRef = Arc::new(Int64Array::from(self.stamps_ns));
        let joints = self.joints.into_iter().flat_map(|(name, columns)| {
            QUANTITIES
                .into_iter()
                .zip(columns)
                .map(move |(quantity, column)| {
                    (format!("{name}.{quantity}"), column.array(rows), true)
                })
        });
        let stamp = std::iter::once(("stamp_ns".to_owned(), stamps, false));
        RecordBatch::try_from_iter_with_nullable(stamp.chain(joints))
    }
}

/// Reads the joint states on `topic`; without one, on the only topic that has them, or on `/joint_states`. Calls
/// `may_go_on` from time to time.
///
/// # Errors
/// If there are none, or if the caller interrupts the reading.
pub fn read(
    path: &Path,
    topic: Option<&str>,
    may_go_on: &dyn Fn() -> Result<(), PyErr>,
) -> Result<Read, ReadError> {
    let recording = tauscope_session::open(path)?;
    let topic = match topic {
        Some(topic) => topic.to_owned(),
        None => only_topic(&recording)?,
    };
    let mut damage = recording.damage().to_vec();
    let mut states = recording.joint_states(&topic)?;
    let mut columns = Columns::default();
    let mut unreadable: usize = 0;
    let mut messages: usize = 0;
    while let Some(state) = states.next_state() {
        if messages.is_multiple_of(STRIDE) {
            may_go_on().map_err(ReadError::Stopped)?;
        }
        messages += 1;
        match state {
            Ok(stamped) => columns.take(stamped.message),
            Err(ArchiveError::Damaged(part)) if damage.contains(&part) => {}
            Err(ArchiveError::Damaged(part)) => damage.push(part),
            Err(ArchiveError::Decode { .. }) => unreadable += 1,
            Err(error) => return Err(error.into()),
        }
    }
    let lost = damage.iter().filter(|part| part.loses_data());
    let mut lost: Vec<String> = lost.map(ToString::to_string).collect();
    if unreadable > 0 {
        lost.push(format!(
            "{unreadable} messages on {topic} cannot be decoded"
        ));
    }
    let batch = columns.batch()?;
    Ok(Read { batch, topic, lost })
}

/// The default topic.
fn only_topic(recording: &Recording) -> Result<String, ReadError> {
    const USUAL: &str = "/joint_states";
    let topics = recording.topics().iter();
    let with_joints = topics.filter(|topic| topic.joint_state_type().is_some());
    let names: Vec<&str> = with_joints.map(|topic| topic.name.as_str()).collect();
    match names.as_slice() {
        [only] => Ok((*only).to_owned()),
        several if several.contains(&USUAL) => Ok(USUAL.to_owned()),
        others => Err(ReadError::Topic {
            path: recording.path().display().to_string(),
            found: if others.is_empty() {
                "no topic carries joint states".to_owned()
            } else {
                format!("several topics carry joint states: {}", others.join(", "))
            },
        }),
    }
}
