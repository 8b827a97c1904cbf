//! Another topic's joint states at the instants of a recording: another twin's effort, or commanded positions.

use std::path::Path;

use tauscope_archive::Recording as Archive;
use tauscope_session::{Gather, Layouts, SessionError, Unusable, Whole, stamp_of};

use super::Recording;

/// Rows of a topic, one number per joint, at strictly increasing times.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Stamps \[ns since the epoch\].
    pub stamp_ns: Vec<i64>,
    /// Values, row-major, in the order of the joints that were asked for.
    pub values: Vec<f64>,
}

impl Series {
    /// Reads the commanded positions \[rad or m\] of a recording; empty if the topic has none.
    ///
    /// # Errors
    /// If the recording cannot be read.
    pub fn of_commands(
        path: &Path,
        topic: &str,
        joint_names: &[String],
    ) -> Result<Self, SessionError> {
        let archive = tauscope_session::open(path)?;
        let position = |whole: &Whole, n: usize| {
            let is_whole = whole.has_position && whole.position[..n].iter().all(|q| q.is_finite());
            is_whole.then(|| whole.position[..n].to_vec())
        };
        Ok(Self::read(&archive, topic, joint_names, &position)?.series)
    }

    /// Reads the rows of a topic whose values `of` accepts.
    fn read(
        archive: &Archive,
        topic: &str,
        joint_names: &[String],
        of: &dyn Fn(&Whole, usize) -> Option<Vec<f64>>,
    ) -> Result<Read, SessionError> {
        let n = joint_names.len();
        let (mut layouts, mut gather) = (Layouts::new(joint_names), Gather::new(n));
        let (mut series, mut messages, mut unreadable) = (Self::default(), 0, 0);
        let mut states = archive.joint_states(topic)?;
        while let Some(state) = states.next_state() {
            let Ok(state) = state else {
                unreadable += 1;
                continue;
            };
            messages += 1;
            let layout = layouts.of(&state.message.name);
            if layout.joints == 0 || layout.twice.is_some() {
                continue;
            }
            let stamp_ns = stamp_of(&state.message.header, state.log_time_ns);
            let times_ns = (stamp_ns, state.log_time_ns);
            let Some(whole) = gather.add(layout, state.message, times_ns, false) else {
                continue;
            };
            let later = series.stamp_ns.last().is_none_or(|last| stamp_ns > *last);
            if let Some(values) = of(&whole, n).filter(|_| later) {
                series.stamp_ns.push(stamp_ns);
                series.values.extend(values);
            }
        }
        Ok(Read {
            series,
            messages,
            unreadable,
            never_named: layouts.never_named(),
        })
    }

    /// Interpolates the values at a time, the ends held, into `row`. There is at least one row. `from` is the index of the row to
    /// search from, at or before the time, and is moved on.
    pub fn at(&self, stamp_ns: i64, from: &mut usize, row: &mut [f64]) {
        let (n, times) = (row.len(), &self.stamp_ns);
        while *from + 2 < times.len() && times[*from + 1] <= stamp_ns {
            *from += 1;
        }
        let next = (*from + 1).min(times.len() - 1);
        let span = times[next] - times[*from];
        let share = if span > 0 {
            ((stamp_ns - times[*from]) as f64 / span as f64).clamp(0.0, 1.0)
        } else {
            0.0
        };
        for (j, value) in row.iter_mut().enumerate() {
            let (a, b) = (self.values[*from * n + j], self.values[next * n + j]);
            *value = a + share * (b - a);
        }
    }
}

/// A series with what was met on reading it.
struct Read {
    series: Series,
    messages: u64,
    unreadable: u64,
    never_named: Vec<String>,
}

impl Recording {
    /// Another twin's effort, interpolated to this recording's instants.
    pub(super) fn read_reference(
        &mut self,
        archive: &Archive,
        topic: &str,
        joint_names: &[String],
    ) -> Result<(), SessionError> {
        let n = joint_names.len();
        let effort = |whole: &Whole, n: usize| {
            let is_whole = whole.has_effort && whole.is_finite(n);
            is_whole.then(|| whole.effort[..n].to_vec())
        };
        let read = Series::read(archive, topic, joint_names, &effort)?;
        self.losses.unreadable += read.unreadable;
        if read.series.stamp_ns.is_empty() {
            let missing = read.never_named;
            let why = if missing.is_empty() {
                let messages = read.messages;
                Unusable::NoSample { messages }
            } else {
                let all = Vec::new();
                Unusable::JointsMissing { missing, all }
            };
            let path = self.path.clone();
            return Err(SessionError::Unusable { path, why });
        }
        let (mut from, mut row) = (0, vec![0.0; n]);
        self.reference = Vec::with_capacity(self.len() * n);
        for &time_s in &self.time_s {
            let stamp_ns = self.start_ns + (time_s * 1e9).round() as i64;
            read.series.at(stamp_ns, &mut from, &mut row);
            self.reference.extend_from_slice(&row);
        }
        Ok(())
    }
}
