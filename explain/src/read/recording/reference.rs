//! Another twin's effort at the instants of a recording.

use tauscope_archive::Recording as Archive;
use tauscope_session::{Gather, Layouts, SessionError, Unusable, stamp_of};

use super::Recording;

impl Recording {
    /// Another twin's effort, interpolated to this recording's instants.
    pub(super) fn read_reference(
        &mut self,
        archive: &Archive,
        topic: &str,
        joint_names: &[String],
    ) -> Result<(), SessionError> {
        let n = joint_names.len();
        let mut times = Vec::new();
        let mut rows: Vec<f64> = Vec::new();
        let (mut layouts, mut gather) = (Layouts::new(joint_names), Gather::new(n));
        let mut states = archive.joint_states(topic)?;
        let mut messages = 0;
        while let Some(state) = states.next_state() {
            let Ok(state) = state else {
                self.losses.unreadable += 1;
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
            let time_s = (stamp_ns - self.start_ns) as f64 * 1e-9;
            let later = times.last().is_none_or(|last| time_s > *last);
            if whole.has_effort && whole.is_finite(n) && later {
                times.push(time_s);
                rows.extend_from_slice(&whole.effort[..n]);
            }
        }
        if times.is_empty() {
            let missing = layouts.never_named();
            let why = if missing.is_empty() {
                Unusable::NoSample { messages }
            } else {
                let all = Vec::new();
                Unusable::JointsMissing { missing, all }
            };
            let path = self.path.clone();
            return Err(SessionError::Unusable { path, why });
        }
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
