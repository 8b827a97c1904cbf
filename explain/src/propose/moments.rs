//! Proposals of effects that begin or end once in the session.

use std::ops::Range;

use crate::data::column::Column;
use crate::physics::active::Hypothesis;
use crate::propose::base::{Base, Proposal};
use crate::propose::grid::best_of;
use crate::propose::intervals::STEPS;
use crate::propose::windows::{BESIDE_S, SCANNED_FACTORS, gain, time_indices};

/// So long before the session and after it nothing changes \[s\].
/// Resolution: longer than any session, so that a recording that is held out lies within.
const FOR_GOOD_S: f64 = 1e6;

impl Base<'_> {
    /// The best time of the session up to which it acts, or from which on.
    pub fn propose_moment(&self, hypothesis: Hypothesis) -> Option<Proposal> {
        let problem = self.problem;
        let times = time_indices(hypothesis);
        let [start, end] = times[..] else { return None };
        let mut shape = vec![0.0; hypothesis.effect.coordinates.len()];
        (shape[start], shape[end]) = (f64::NEG_INFINITY, f64::INFINITY);
        let all = self.fit.columns(problem, hypothesis, &shape);
        let all = &all.factors;
        let scanned = &all[..all.len().min(SCANNED_FACTORS)];
        // Bins of even length within each recording, in the order of the session.
        let mut order: Vec<usize> = (0..problem.tracks.len()).collect();
        let session_s = |track: &usize| problem.tracks[*track].track.session_s;
        order.sort_by(|a, b| session_s(a).total_cmp(&session_s(b)));
        let length_s = |track: usize| self.longest_s(Some(track)) + BESIDE_S;
        let mut place = vec![0; order.len()];
        for (at, &track) in order.iter().enumerate() {
            place[track] = at;
        }
        let bin_of = |track: usize, k: usize| {
            let share = problem.tracks[track].track.time_s[k] / length_s(track);
            place[track] * STEPS + ((share * STEPS as f64) as usize).min(STEPS - 1)
        };
        let bins = order.len() * STEPS;
        let (gram, right) = self.running_sums(scanned, &order, bins, bin_of);
        let score = |bins: &Range<usize>| {
            let normal = &gram[bins.end] - &gram[bins.start];
            gain(normal, &(&right[bins.end] - &right[bins.start]))
        };
        let parts: Vec<Range<usize>> = (1..bins).flat_map(|bin| [0..bin, bin..bins]).collect();
        let (best, _) = best_of(parts.iter().map(score))?;
        let part = &parts[best];
        let at_s = |bin: usize| {
            let track = order[bin / STEPS];
            let within_s = (bin % STEPS) as f64 / STEPS as f64 * length_s(track);
            session_s(&track) + within_s
        };
        shape[start] = if part.start == 0 {
            -FOR_GOOD_S
        } else {
            at_s(part.start)
        };
        shape[end] = if part.end == bins {
            FOR_GOOD_S
        } else {
            at_s(part.end)
        };
        let masked: Vec<Column> = (all.iter())
            .map(|column| self.within_session(column, shape[start]..shape[end]))
            .collect();
        let mut proposal = self.propose_columns(hypothesis, &shape, None, &masked)?;
        // For the choice of one among these.
        proposal.penalty += (parts.len() as f64).ln();
        Some(proposal)
    }

    /// A column with what lies outside an interval of the session \[s\] set to zero.
    fn within_session(&self, column: &Column, interval_s: Range<f64>) -> Column {
        let problem = self.problem;
        let mut masked = column.clone();
        for track in &problem.tracks {
            for (row, &k) in track.rows().zip(&track.compared) {
                if !interval_s.contains(&(track.track.session_s + track.track.time_s[k])) {
                    // One block per joint of the column.
                    for block in masked.values.chunks_mut(problem.rows) {
                        block[row] = 0.0;
                    }
                }
            }
        }
        masked
    }
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::effect;
    use tauscope_dynamics::{Inertia, Model};

    use super::*;
    use crate::fit::fitted::Fit;
    use crate::fixture::{Noise, at_joint, model, problem, problem_with, recording};
    use crate::physics::active::Whereabouts;

    /// What is said of three recordings in the first `with` of which the small arm carries 2 kg: from when to when, and
    /// how much.
    fn said(with: usize) -> [f64; 3] {
        let bare = model();
        let tool = bare.tool_link();
        let mut noise = Noise(0x9E37_79B9_7F4A_7C15);
        let recordings: Vec<_> = (0..3)
            .map(|k| {
                let mut arm: Model = bare.clone();
                if k < with {
                    arm.attach(tool, Inertia::new(2.0, [0.0, 0.0, 0.1], [0.0; 6]));
                }
                recording(&arm, k as u64 + 1, |_, _, effort| {
                    for effort in effort {
                        *effort += 0.05 * noise.next();
                    }
                })
            })
            .collect();
        let problem = problem(&bare, &recordings);
        let hypothesis = Hypothesis {
            effect: effect("payload_in_session").unwrap(),
            place: Whereabouts {
                link: tool,
                ..Whereabouts::default()
            },
        };
        let nothing = Fit::new(&problem, Vec::new());
        let proposal = Base::new(&problem, &nothing, 40)
            .propose_moment(hypothesis)
            .unwrap();
        let x = &proposal.active.coordinates;
        let [from_s, to_s] = [x[10], x[11]];
        let (begins, ends) = (
            problem.tracks[with - 1].track.session_s,
            problem.tracks[with].track.session_s,
        );
        assert!(begins < to_s && to_s <= ends, "{begins} {to_s} {ends}");
        [from_s, to_s, x[0]]
    }

    #[test]
    fn what_is_put_down_between_two_recordings_is_carried_up_to_then() {
        for with in [1, 2] {
            let [from_s, _, mass_kg] = said(with);
            assert!(from_s < -1.0 && (mass_kg - 2.0).abs() < 0.1, "{mass_kg}");
        }
    }

    #[test]
    fn what_changes_once_is_told_with_what_it_was_before_and_is_since() {
        for (effect, sizes) in [
            ("viscous_step", [1.5, 0.5]),
            ("bias_step", [-0.5, 1.0]),
            ("gain_step", [0.0, 0.4]),
        ] {
            let mut samples = 0;
            let problem = problem_with(6, |_, qd, effort| {
                samples += 1;
                let size = sizes[usize::from(samples > 1200)];
                effort[1] += match effect {
                    "viscous_step" => size * qd[1],
                    "bias_step" => size,
                    _ => size * effort[1],
                };
            });
            let nothing = Fit::new(&problem, Vec::new());
            let base = Base::new(&problem, &nothing, 40);
            let proposal = base.propose_in_time(at_joint(effect, 1)).unwrap();
            let [before, after, _] = proposal.active.coordinates[..] else {
                panic!("three numbers");
            };
            let near = |is: f64, wanted: f64| (is - wanted).abs() < 0.1;
            assert!(
                near(before, sizes[0]) && near(after, sizes[1]),
                "{effect}: {before} {after}"
            );
        }
    }
}
