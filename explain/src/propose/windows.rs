//! Proposals of effects with a time: a change point, an interval within every recording, an interval in one recording.
//! Running sums scan all intervals; the best are tried exactly.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::CoordinateKind;

use crate::data::column::Column;
use crate::physics::active::Hypothesis;
use crate::physics::active::TimeKind;
use crate::propose::base::{Base, Proposal};
use crate::propose::grid::best_of;
use crate::propose::intervals::{STEPS, Steps, intervals};

/// Shortest interval that is searched \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const SHORTEST_S: f64 = 0.35;
/// How many of the best intervals are tried exactly.
/// Tuned: by hand, for what it costs in time; not swept.
const TRIED: usize = 4;
/// Rows that a change point needs on either side.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_ROWS: usize = 8;
/// Shortest and longest step on which the ends of short intervals are searched \[s\].
/// Resolution: half the step costs four times the time; the fit refines the times afterwards.
const LEAST_STEP_S: f64 = 0.05;
const MOST_STEP_S: f64 = 0.1;
/// Factors that are scanned. The inertias of a payload come after them and hardly change the effort.
/// Physical: a payload's mass and first moments of mass.
pub(super) const SCANNED_FACTORS: usize = 4;
/// An effect of a whole recording begins so long before it and ends so long after it \[s\].
/// Resolution: the ends lie where no row is, so that the fit leaves them there.
pub(super) const BESIDE_S: f64 = 0.02;
/// Added to the diagonal of an interval's normal equations, as a share of their trace.
/// Resolution: guards the factorisation of dependent columns.
const RIDGE: f64 = 1e-9;
/// The same where all columns are zero.
/// Resolution: guards the factorisation of a zero matrix.
const LEAST_RIDGE: f64 = 1e-12;

impl Base<'_> {
    /// The best proposal of any hypothesis, in time or not.
    pub fn propose_in_time(&self, hypothesis: Hypothesis) -> Option<Proposal> {
        match hypothesis.time_kind() {
            TimeKind::Always if hypothesis.effect.is_surface() => self.propose_wall(hypothesis),
            TimeKind::Always => self.propose(hypothesis),
            TimeKind::Step => self.propose_step(hypothesis),
            TimeKind::EveryRecording => self.propose_interval(hypothesis, None),
            TimeKind::Once if hypothesis.effect.traits.in_session => {
                self.propose_moment(hypothesis)
            }
            TimeKind::Once => (0..self.problem.tracks.len())
                .filter_map(|track| {
                    if hypothesis.effect.traits.fills_recording {
                        self.propose_recording(hypothesis, track)
                    } else {
                        self.propose_interval(hypothesis, Some(track))
                    }
                })
                .max_by(|a, b| a.evidence().total_cmp(&b.evidence())),
        }
    }

    /// The best change point, with one factor before it and another after it.
    fn propose_step(&self, hypothesis: Hypothesis) -> Option<Proposal> {
        let problem = self.problem;
        let mut shape = vec![0.0; hypothesis.effect.coordinates.len()];
        let time = time_index(hypothesis)?;
        shape[time] = f64::NEG_INFINITY;
        let all = self.fit.columns(problem, hypothesis, &shape);
        // With the change before everything, the second factor's column is the whole effect.
        let whole = all.factors.last()?;
        // An effect at a joint that all joints feel is told by where it is.
        let joint = hypothesis.place.joint;
        let split = |first: usize| {
            let (mut before, mut after) = (Column::clone(whole), Column::clone(whole));
            // One block per joint of the column.
            for block in before.values.chunks_mut(problem.rows) {
                block[first..].fill(0.0);
            }
            for block in after.values.chunks_mut(problem.rows) {
                block[..first].fill(0.0);
            }
            [before, after]
        };
        let weight = &problem.weight[problem.joint_rows(joint)];
        let own = whole.of_joint(joint, problem.rows)?;
        let moves = |(value, weight): (&f64, &f64)| *value != 0.0 && *weight > 0.0;
        let rows: Vec<usize> = (0..problem.rows)
            .filter(|&row| moves((&own[row], &weight[row])))
            .collect();
        let mut times = Vec::new();
        for track in &problem.tracks {
            let own = track.rows();
            let stride = (own.len() / STEPS).max(1);
            for first in own.clone().step_by(stride) {
                let before = rows.partition_point(|row| *row < first);
                if before >= LEAST_ROWS && rows.len() - before >= LEAST_ROWS {
                    let at = track.compared[first - own.start];
                    times.push((first, track.track.session_s + track.track.time_s[at]));
                }
            }
        }
        let firsts: Vec<usize> = times.iter().map(|(first, _)| *first).collect();
        let scores = self.first_order_scores_of_split(hypothesis, whole, &firsts);
        let (best, _) = best_of(scores.into_iter())?;
        let (first, time_s) = times[best];
        shape[time] = time_s;
        let mut proposal = self.propose_columns(hypothesis, &shape, None, &split(first))?;
        // For the choice of one time among many.
        proposal.penalty += (STEPS as f64).ln();
        Some(proposal)
    }

    /// The best interval of recording time, in one recording or in all.
    fn propose_interval(&self, hypothesis: Hypothesis, only: Option<usize>) -> Option<Proposal> {
        let problem = self.problem;
        let times = time_indices(hypothesis);
        let [start, end] = times[..] else { return None };
        let mut shape = vec![0.0; hypothesis.effect.coordinates.len()];
        (shape[start], shape[end]) = (f64::NEG_INFINITY, f64::INFINITY);
        let all = self.fit.columns(problem, hypothesis, &shape);
        let all = &all.factors;
        let scanned = &all[..all.len().min(SCANNED_FACTORS)];
        let intervals = self.scan(scanned, only);
        let scores = intervals.iter().map(|&interval| {
            let masked = self.all_within(all, interval, only);
            self.first_order_score(hypothesis, None, &masked)
        });
        let (best, _) = best_of(scores)?;
        self.propose_within(hypothesis, intervals[best], only)
    }

    /// The best factors for the whole of one recording, where there are others.
    pub fn propose_recording(&self, hypothesis: Hypothesis, track: usize) -> Option<Proposal> {
        let (first_s, last_s) = (-BESIDE_S, self.longest_s(Some(track)) + BESIDE_S);
        let others = self.problem.tracks.len() > 1;
        others.then(|| self.propose_within(hypothesis, (first_s, last_s), Some(track)))?
    }

    /// The best factors within an interval of recording time \[s\], in one recording or in all.
    pub fn propose_within(
        &self,
        hypothesis: Hypothesis,
        (from_s, to_s): (f64, f64),
        only: Option<usize>,
    ) -> Option<Proposal> {
        let times = time_indices(hypothesis);
        let [start, end] = times[..] else { return None };
        let mut shape = vec![0.0; hypothesis.effect.coordinates.len()];
        (shape[start], shape[end]) = (f64::NEG_INFINITY, f64::INFINITY);
        let all = self.fit.columns(self.problem, hypothesis, &shape);
        let masked = self.all_within(&all.factors, (from_s, to_s), only);
        let session_s = only.map_or(0.0, |track| self.problem.tracks[track].track.session_s);
        (shape[start], shape[end]) = (session_s + from_s, session_s + to_s);
        let mut proposal = self.propose_columns(hypothesis, &shape, None, &masked)?;
        // For the choice of one beginning and one end among many.
        let steps = (self.longest_s(only) / MOST_STEP_S).max(STEPS as f64);
        proposal.penalty += 2.0 * steps.ln();
        Some(proposal)
    }

    fn all_within(
        &self,
        columns: &[Arc<Column>],
        (from_s, to_s): (f64, f64),
        only: Option<usize>,
    ) -> Vec<Column> {
        let within = |column: &Arc<Column>| self.within(column, from_s, to_s, only);
        columns.iter().map(within).collect()
    }

    /// A column with what lies outside an interval of recording time \[s\] set to zero.
    fn within(&self, column: &Column, from_s: f64, to_s: f64, only: Option<usize>) -> Column {
        let problem = self.problem;
        let mut masked = column.clone();
        let blocks = if column.joint.is_some() {
            1
        } else {
            problem.joints
        };
        for (r, track) in problem.tracks.iter().enumerate() {
            for (row, &k) in track.rows().zip(&track.compared) {
                let t = track.track.time_s[k];
                if only.is_some_and(|only| only != r) || t < from_s || t >= to_s {
                    for j in 0..blocks {
                        masked.values[j * problem.rows + row] = 0.0;
                    }
                }
            }
        }
        masked
    }

    /// Normal equations of columns, summed over the rows of all bins before each.
    pub(super) fn running_sums(
        &self,
        columns: &[Arc<Column>],
        tracks: &[usize],
        bins: usize,
        bin_of: impl Fn(usize, usize) -> usize,
    ) -> (Vec<DMatrix<f64>>, Vec<DVector<f64>>) {
        let problem = self.problem;
        let q = columns.len();
        let mut gram = vec![DMatrix::<f64>::zeros(q, q); bins + 1];
        let mut right = vec![DVector::<f64>::zeros(q); bins + 1];
        for &r in tracks {
            let track = &problem.tracks[r];
            for (row, &k) in track.rows().zip(&track.compared) {
                let bin = bin_of(r, k) + 1;
                for j in 0..problem.joints {
                    let at = j * problem.rows + row;
                    let weight = problem.weight[at] / self.fit.variance[j];
                    if weight == 0.0 {
                        continue;
                    }
                    let value = |c: &Arc<Column>| {
                        c.of_joint(j, problem.rows)
                            .map_or(0.0, |values| values[row])
                    };
                    let x: DVector<f64> = DVector::from_iterator(q, columns.iter().map(value));
                    gram[bin].ger(weight, &x, &x, 1.0);
                    right[bin].axpy(weight * self.fit.residual[at], &x, 1.0);
                }
            }
        }
        for bin in 1..=bins {
            let (before, here) = gram.split_at_mut(bin);
            here[0] += &before[bin - 1];
            let (before, here) = right.split_at_mut(bin);
            here[0] += &before[bin - 1];
        }
        (gram, right)
    }

    /// The most promising intervals \[s of recording time\]. The fit's own parameters stay fixed.
    fn scan(&self, columns: &[Arc<Column>], only: Option<usize>) -> Vec<(f64, f64)> {
        let problem = self.problem;
        let tracks: Vec<usize> = match only {
            Some(track) => vec![track],
            None => (0..problem.tracks.len()).collect(),
        };
        let duration_s = self.longest_s(only);
        let bin_s = (duration_s / STEPS as f64).clamp(LEAST_STEP_S, MOST_STEP_S);
        let bins = (duration_s / bin_s).ceil() as usize + 1;
        let bin_of = |track: usize, k: usize| {
            let time_s = problem.tracks[track].track.time_s[k];
            (time_s / bin_s) as usize
        };
        let (gram, right) = self.running_sums(columns, &tracks, bins, bin_of);
        let shortest = ((SHORTEST_S / bin_s).ceil() as usize).max(1);
        let mut found: Vec<(f64, Steps)> = Vec::new();
        for interval in intervals(bins, shortest) {
            let normal = &gram[interval.to] - &gram[interval.from];
            let rhs = &right[interval.to] - &right[interval.from];
            if let Some(score) = gain(normal, &rhs) {
                found.push((score, interval));
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        // Nearly equal intervals are kept once.
        let mut kept: Vec<Steps> = Vec::new();
        for (_, interval) in found {
            if !kept.iter().any(|other| other.is_near(&interval)) {
                kept.push(interval);
            }
            if kept.len() == TRIED {
                break;
            }
        }
        let seconds = |step: usize| step as f64 * bin_s;
        kept.iter()
            .map(|interval| (seconds(interval.from), seconds(interval.to)))
            .collect()
    }

    /// How long the recording lasts, or the longest of all \[s\].
    pub(super) fn longest_s(&self, only: Option<usize>) -> f64 {
        let tracks = self.problem.tracks.iter().enumerate();
        tracks
            .filter(|(r, _)| only.is_none_or(|only| only == *r))
            .filter_map(|(_, track)| track.track.time_s.last().copied())
            .fold(0.0, f64::max)
    }
}

pub(super) fn time_indices(hypothesis: Hypothesis) -> Vec<usize> {
    let is_time = |kind| {
        matches!(
            kind,
            CoordinateKind::RecordingTime | CoordinateKind::SessionTime
        )
    };
    let coordinates = hypothesis.effect.coordinates.iter().enumerate();
    coordinates
        .filter(|(_, c)| is_time(c.kind))
        .map(|(i, _)| i)
        .collect()
}

/// By how much the best factors reduce the squares, from normal equations.
pub(super) fn gain(mut normal: DMatrix<f64>, right: &DVector<f64>) -> Option<f64> {
    let ridge = RIDGE * normal.trace() + LEAST_RIDGE;
    for a in 0..right.len() {
        normal[(a, a)] += ridge;
    }
    let factor = normal.cholesky()?;
    Some(right.dot(&factor.solve(right)))
}

fn time_index(hypothesis: Hypothesis) -> Option<usize> {
    time_indices(hypothesis).first().copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::fitted::Fit;
    use crate::fixture::{at_joint, problem_with};

    #[test]
    fn a_change_is_found_at_the_time_at_which_each_by_itself_would_score_best() {
        let (mut samples, friction_nm) = (0, [0.5, 1.5]);
        let problem = problem_with(6, |_, qd, effort| {
            samples += 1;
            effort[1] += friction_nm[usize::from(samples > 1200)] * qd[1].signum();
        });
        let hypothesis = at_joint("friction_step", 1);
        let fit = Fit::new(
            &problem,
            vec![at_joint("viscous_friction", 0).with(vec![0.2])],
        );
        let base = Base::new(&problem, &fit, 40);
        let shape = [0.0, 0.0, f64::NEG_INFINITY];
        let whole = Column::clone(
            fit.columns(&problem, hypothesis, &shape)
                .factors
                .last()
                .unwrap(),
        );
        let firsts: Vec<usize> = (10..problem.rows - 10).step_by(7).collect();
        let together = base.first_order_scores_of_split(hypothesis, &whole, &firsts);
        for (&first, together) in firsts.iter().zip(together) {
            let (mut before, mut after) = (whole.clone(), whole.clone());
            before.values[first..].fill(0.0);
            after.values[..first].fill(0.0);
            let alone = base.first_order_score(hypothesis, None, &[before, after]);
            assert!((together.unwrap() - alone.unwrap()).abs() < 1e-6, "{first}");
        }
    }
}
