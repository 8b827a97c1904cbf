//! Rows of a recording that are left out on reading.

use super::Recording;

/// Messages and rows that were left out on reading.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Losses {
    /// Refused messages and states; the findings state the reasons.
    pub refused: u64,
    /// Rows that repeat the stamp and all values of the preceding row.
    pub repeated: u64,
    /// Rows of a moving arm that repeat all values of the preceding row with a new stamp.
    pub stale: u64,
    /// Rows without a measured effort, in a recording with measured efforts.
    pub unmeasured: u64,
    /// Messages that could not be decoded.
    pub unreadable: u64,
    /// Parts of the file that cannot be read, e.g. a torn tail.
    pub damaged: u64,
}

impl Losses {
    /// Returns the number of lost rows; repeated and stale rows are not lost.
    pub fn lost(&self) -> u64 {
        self.refused + self.unmeasured + self.unreadable + self.damaged
    }
}

impl Recording {
    /// Removes the samples whose efforts are not `measured`.
    pub(super) fn keep_measured(&mut self, measured: &[bool]) {
        let unmeasured = measured.iter().filter(|is_measured| !**is_measured);
        self.losses.unmeasured += unmeasured.count() as u64;
        self.keep(measured);
    }

    /// Removes the samples that repeat all values of the preceding one although a joint has a velocity. A driver that
    /// publishes faster than it reads sends old measurements with new stamps. Their position would stop and then
    /// catch up, which differentiates to a velocity that the arm did not have.
    pub(super) fn leave_out_stale(&mut self) {
        let count = self.len();
        let n = self.position.len() / count.max(1);
        let same = |all: &[f64], k: usize| {
            all.is_empty() || all[k * n..(k + 1) * n] == all[(k - 1) * n..k * n]
        };
        let moves = |k: usize| {
            let own = self.velocity.get(k * n..(k + 1) * n).unwrap_or_default();
            own.iter().any(|velocity| *velocity != 0.0)
        };
        let is_stale = |k: usize| {
            let all = [&self.position, &self.velocity, &self.effort];
            k > 0 && moves(k) && all.iter().all(|values| same(values, k))
        };
        let is_fresh: Vec<bool> = (0..count).map(|k| !is_stale(k)).collect();
        let stale = is_fresh.iter().filter(|is_fresh| !**is_fresh).count();
        if stale > 0 {
            self.losses.stale = stale as u64;
            self.keep(&is_fresh);
        }
    }

    /// Splits the recording at the time `at_s` \[s\]. The first part keeps the findings and losses.
    pub(crate) fn parted(mut self, at_s: f64) -> (Self, Self) {
        let is_late: Vec<bool> = self.time_s.iter().map(|time_s| *time_s >= at_s).collect();
        let of = |recording: &mut Self, late: bool| {
            let rows = recording.sample_of_row.iter_mut();
            rows.for_each(|row| *row = row.filter(|sample| is_late[*sample] == late));
            let kept: Vec<bool> = is_late.iter().map(|is_late| *is_late == late).collect();
            recording.keep(&kept);
        };
        let mut end = self.clone();
        end.losses = Losses::default();
        end.findings.clear();
        of(&mut end, true);
        of(&mut self, false);
        (self, end)
    }

    /// Removes all samples except `is_kept`. Rows of a removed sample refer to the last kept sample before it.
    pub(crate) fn keep(&mut self, is_kept: &[bool]) {
        let n = self.position.len() / is_kept.len().max(1);
        let kept: Vec<usize> = (0..is_kept.len()).filter(|&k| is_kept[k]).collect();
        let rows = |all: &[f64]| -> Vec<f64> {
            let row = |&k: &usize| all.get(k * n..(k + 1) * n).unwrap_or_default().iter();
            kept.iter().flat_map(row).copied().collect()
        };
        for all in [
            &mut self.position,
            &mut self.velocity,
            &mut self.effort,
            &mut self.reference,
        ] {
            *all = rows(all);
        }
        let start_s = kept.first().map_or(0.0, |&first| self.time_s[first]);
        self.start_ns += (start_s * 1e9).round() as i64;
        self.time_s = kept.iter().map(|&k| self.time_s[k] - start_s).collect();
        let now_at = |sample: usize| kept.partition_point(|&k| k <= sample).saturating_sub(1);
        for sample in self.sample_of_row.iter_mut().flatten() {
            *sample = now_at(*sample);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::fixture;

    #[test]
    fn old_measurements_with_new_stamps_are_left_out_while_the_arm_moves() {
        let mut recording = fixture::recording(&fixture::model(), 3, |_, _, _| {});
        recording.velocity = vec![0.1; recording.position.len()];
        let whole = recording.clone();
        for values in [&mut recording.position, &mut recording.effort] {
            values.copy_within(10..12, 12);
            values.copy_within(10..12, 14);
        }
        let mut still = recording.clone();
        recording.leave_out_stale();
        assert_eq!(recording.losses.stale, 2);
        assert!((recording.time_s[6] - whole.time_s[8]).abs() < 1e-12);
        assert_eq!(recording.sample_of_row[4..9], [4, 5, 5, 5, 6].map(Some));
        // An arm at rest measures the same values again.
        still.velocity.fill(0.0);
        still.leave_out_stale();
        assert_eq!(still.len(), whole.len());
    }

    #[test]
    fn samples_without_a_measurement_are_left_out_and_their_rows_answered_by_the_one_before() {
        let mut recording = fixture::recording(&fixture::model(), 3, |_, _, _| {});
        let whole = recording.clone();
        let count = whole.len();
        recording.sample_of_row = (0..count).map(Some).collect();
        let measured: Vec<bool> = (0..count).map(|k| k > 0 && k % 3 != 0).collect();
        recording.keep_measured(&measured);
        assert_eq!(recording.losses.unmeasured as usize, count.div_ceil(3));
        assert_eq!(recording.len(), count - count.div_ceil(3));
        assert_eq!(
            recording.position[..4],
            [&whole.position[2..4], &whole.position[4..6]].concat()
        );
        assert!(recording.time_s[0] == 0.0 && recording.start_ns > whole.start_ns);
        assert_eq!(recording.sample_of_row[..6], [0, 0, 1, 1, 2, 3].map(Some));
    }
}
