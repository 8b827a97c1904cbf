//! Conversion of the rows of an episode to joint states.

use std::path::PathBuf;

use super::layout::{Element, Quantity};
use super::{Episode, TIMESTAMP, TOPIC};
use crate::csv_file::limits;
use crate::cursor::{Cursor, RawMessage};
use crate::error::ArchiveError;
use crate::lerobot_error::{LerobotError, LerobotProblem};
use crate::parquet_file::{Physical, Rows};
use crate::ros::{self, JointState, Time};

/// Largest deviation of a timestamp from the grid of the frame rate that is rounded to the grid \[s\].
/// Physical: LeRobot rejects data sets with larger deviations (`tolerance_s`); the resolution of a `float32` after
/// ten minutes is 0.06 ms.
const TOLERANCE_S: f64 = 1e-4;
const NS_PER_S: f64 = 1e9;

/// Cursor over the rows of an episode; holds one page of each column in memory.
pub(crate) struct EpisodeCursor {
    path: PathBuf,
    first_row: u64,
    rows: u64,
    /// Number of rows read.
    read: u64,
    times: Option<Rows>,
    time_s: Vec<f64>,
    /// Frame rate, if the time of a row follows from its number \[Hz\].
    grid_hz: Option<f64>,
    columns: Vec<Rows>,
    /// Current row of each column.
    values: Vec<Vec<f64>>,
    features: Vec<String>,
    quantities: [Quantity; 3],
    scale: f64,
    before_ns: i64,
    state: JointState,
    current: Option<i64>,
    body: Vec<u8>,
}

impl EpisodeCursor {
    pub(super) fn open(episode: &Episode) -> Result<Self, ArchiveError> {
        let (file, layout) = (&episode.file, &episode.layout);
        let times = match file.physical(TIMESTAMP) {
            Some(_) => Some(file.column(TIMESTAMP, episode.first_row)?),
            None => None,
        };
        // Time in `float32` is too coarse to differentiate positions, so it is rounded to the grid of the frame rate.
        let is_coarse = file.physical(TIMESTAMP) != Some(Physical::Double);
        let columns = layout.features.iter();
        let columns = columns.map(|feature| file.column(feature, episode.first_row));
        let columns = columns.collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            path: file.path().to_owned(),
            first_row: episode.first_row,
            rows: episode.rows,
            read: 0,
            times,
            time_s: Vec::with_capacity(1),
            grid_hz: episode.fps.filter(|_| is_coarse),
            values: vec![Vec::new(); columns.len()],
            columns,
            features: layout.features.clone(),
            quantities: [&layout.position, &layout.velocity, &layout.effort].map(Quantity::clone),
            scale: layout.scale,
            before_ns: i64::MIN,
            state: JointState {
                name: layout.joints.clone(),
                ..JointState::default()
            },
            current: None,
            body: Vec::new(),
        })
    }

    /// Returns the joint state of the last row read.
    pub(super) fn state(&self) -> &JointState {
        &self.state
    }

    /// Reads the next row. Returns its time \[ns\]; `None` at the end of the episode.
    pub(super) fn next_state(&mut self) -> Result<Option<i64>, ArchiveError> {
        if self.read >= self.rows {
            return Ok(None);
        }
        for (column, values) in self.columns.iter_mut().zip(&mut self.values) {
            column.next_row(values)?;
        }
        let time_ns = self.take_time()?;
        for quantity in 0..self.quantities.len() {
            self.take_quantity(quantity)?;
        }
        self.state.header.stamp = Time::from_ns(time_ns);
        self.read += 1;
        Ok(Some(time_ns))
    }

    /// Copies a quantity of the current row into the joint state.
    fn take_quantity(&mut self, quantity: usize) -> Result<(), ArchiveError> {
        let store = match quantity {
            0 => &mut self.state.position,
            1 => &mut self.state.velocity,
            _ => &mut self.state.effort,
        };
        let mut values = std::mem::take(store);
        values.clear();
        let scale = if quantity < 2 { self.scale } else { 1.0 };
        let what = ["position", "velocity", "effort"][quantity];
        for element in &self.quantities[quantity] {
            let Some(Element { feature, at }) = *element else {
                values.push(f64::NAN);
                continue;
            };
            let row = &self.values[feature];
            if let Some(value) = row.get(at) {
                values.push(value * scale);
                continue;
            }
            let reason = format!(
                "the row has {} numbers, but meta/info.json places the {what} of a joint at index {at}",
                row.len()
            );
            return Err(self.refuse(self.features[feature].clone(), reason));
        }
        match quantity {
            0 => self.state.position = values,
            1 => self.state.velocity = values,
            _ => self.state.effort = values,
        }
        Ok(())
    }

    fn take_time(&mut self) -> Result<i64, ArchiveError> {
        let own_s = match &mut self.times {
            Some(times) => {
                times.next_row(&mut self.time_s)?;
                Some(self.time_s.first().copied().unwrap_or(f64::NAN))
            }
            None => None,
        };
        let grid_s = self.grid_hz.map(|hz| self.read as f64 / hz);
        let time_s = match (own_s, grid_s) {
            (Some(own_s), Some(grid_s)) if (own_s - grid_s).abs() > TOLERANCE_S => own_s,
            (_, Some(grid_s)) if own_s.is_none_or(f64::is_finite) => grid_s,
            (Some(own_s), _) => own_s,
            (None, _) => {
                let reason = "there is neither a column `timestamp` nor an `fps` in meta/info.json";
                return Err(self.refuse(TIMESTAMP.to_owned(), reason.to_owned()));
            }
        };
        if !(0.0..=limits::TIME_S).contains(&time_s) {
            let reason = format!("{time_s} is not a valid time in seconds");
            return Err(self.refuse(TIMESTAMP.to_owned(), reason));
        }
        let time_ns = (time_s * NS_PER_S).round() as i64;
        if time_ns < self.before_ns {
            let before_s = self.before_ns as f64 / NS_PER_S;
            let reason = format!("{time_s} s comes after {before_s} s: time runs backwards");
            return Err(self.refuse(TIMESTAMP.to_owned(), reason));
        }
        self.before_ns = time_ns;
        Ok(time_ns)
    }

    fn refuse(&self, feature: String, reason: String) -> ArchiveError {
        let problem = LerobotProblem::Row {
            row: self.first_row + self.read,
            feature,
            reason,
        };
        LerobotError::new(&self.path, problem).into()
    }
}

impl Cursor for EpisodeCursor {
    fn advance(&mut self) -> Result<bool, ArchiveError> {
        self.current = self.next_state()?;
        if self.current.is_some() {
            ros::encode(&self.state, &mut self.body).map_err(|source| ArchiveError::Encode {
                path: self.path.clone(),
                topic: TOPIC.to_owned(),
                source,
            })?;
        }
        Ok(self.current.is_some())
    }

    fn current(&self) -> Option<RawMessage<'_>> {
        self.current.map(|time_ns| RawMessage {
            topic: 0,
            log_time_ns: time_ns,
            publish_time_ns: time_ns,
            sequence: 0,
            at: self.first_row + self.read - 1,
            body: &self.body,
        })
    }
}
