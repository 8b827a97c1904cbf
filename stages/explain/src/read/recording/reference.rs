//! Another twin's effort at the instants of a recording.

use tauscope_archive::Recording as Archive;

use super::{Recording, RecordingError, indices};

impl Recording {
    /// Another twin's effort, interpolated to this recording's instants.
    pub(super) fn read_reference(
        &mut self,
        archive: &Archive,
        topic: &str,
        joint_names: &[String],
    ) -> Result<(), RecordingError> {
        let mut times = Vec::new();
        let mut rows: Vec<f64> = Vec::new();
        let mut states = archive.joint_states(topic)?;
        let mut order = Vec::new();
        while let Some(state) = states.next_state() {
            let Ok(stamped) = state else {
                self.losses.unreadable += 1;
                continue;
            };
            let message = stamped.message;
            if order.is_empty() {
                order = indices(&message.name, joint_names).map_err(|joint| {
                    RecordingError::MissingJoint {
                        path: self.path.clone(),
                        joint,
                        known: message.name.join(", "),
                    }
                })?;
            }
            let time_s = (message.header.stamp.ns() - self.start_ns) as f64 * 1e-9;
            let efforts = order.iter().map_while(|&at| message.effort.get(at));
            let row: Vec<f64> = efforts.copied().collect();
            let later = times.last().is_none_or(|last| time_s > *last);
            if row.len() == order.len() && row.iter().all(|x| x.is_finite()) && later {
                times.push(time_s);
                rows.extend(row);
            }
        }
        if times.is_empty() {
            return Err(RecordingError::Empty {
                path: self.path.clone(),
                topic: topic.to_owned(),
            });
        }
        let n = joint_names.len();
        self.reference = Vec::with_capacity(self.len() * n);
        let mut at = 0;
        for &time_s in &self.time_s {
            while at + 2 < times.len() && times[at + 1] <= time_s {
                at += 1;
            }
            let next = (at + 1).min(times.len() - 1);
            let span = times[next] - times[at];
            let share = if span > 0.0 {
                ((time_s - times[at]) / span).clamp(0.0, 1.0)
            } else {
                0.0
            };
            for j in 0..n {
                let (a, b) = (rows[at * n + j], rows[next * n + j]);
                self.reference.push(a + share * (b - a));
            }
        }
        Ok(())
    }
}
