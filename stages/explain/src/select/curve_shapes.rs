//! Curves over motion or time, for a residual that no effect of the library fits.

use tauscope_dynamics::terms::{Against, MotionSample, Table, UNKNOWN};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::data::track::FitTrack;
use crate::physics::active::{Active, Hypothesis, Whereabouts, held_knots};
use crate::select::propose::Base;

/// Knots of a curve.
/// Tuned: by hand, on no recorded seeds; not swept.
const KNOTS: usize = 10;
/// Knots of a curve over position that resolves a local defect, such as a worn segment of a gear.
/// Tuned: by hand, on no recorded seeds; not swept.
const MANY_KNOTS: usize = 28;
/// Knots that a curve must have at different places.
/// Statistical: two knots are a straight line, which effects of the library already describe.
const LEAST_KNOTS: usize = 3;
/// Knots nearer than this share of their mean spacing are merged.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_SPACING: f64 = 0.2;
/// Knots of a periodic curve, per period.
/// Tuned: by hand, on no recorded seeds; not swept.
const KNOTS_OF_PERIOD: usize = 8;
/// Periods that must fit into the whole time span.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_PERIODS: f64 = 3.0;
/// Periods that must fit into the longest recording.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_IN_RECORDING: f64 = 1.5;
/// Frequency steps per inverse of the time span.
/// Resolution: a finer grid costs time in proportion; a peak half a step away keeps 95 % of its power and is
/// interpolated.
const STEPS_OF_FREQUENCY: f64 = 4.0;
/// A periodic effect is not looked for over a longer time span, over which it would lose phase \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const LONGEST_IN_STEP_S: f64 = 1200.0;
/// Values of a curve below this share of the largest are set to zero.
/// Tuned: by hand, on no recorded seeds; not swept.
const EVIDENT: f64 = 0.2;

/// A curve in a joint, and its gain.
#[derive(Debug, Clone)]
pub struct CurveProposal {
    /// The `unknown` effect.
    pub active: Active,
    /// Gain of log-likelihood.
    pub gain: f64,
    /// Penalty for its free values and for the number of curves tried \[nats\].
    pub penalty: f64,
}

impl CurveProposal {
    /// Evidence for it \[nats\].
    pub fn evidence(&self) -> f64 {
        self.gain - self.penalty
    }
}

impl Base<'_> {
    /// The curve with the most evidence at a joint.
    pub fn propose_curve(&self, joint: usize) -> Option<CurveProposal> {
        let mut candidates = curves(self.problem, joint);
        candidates.extend(self.repeated(joint));
        let count = candidates.len() as f64;
        let mut best: Option<CurveProposal> = None;
        for curve in candidates {
            let Some(mut proposal) = self.try_curve(joint, &curve) else {
                continue;
            };
            proposal.penalty += count.ln();
            if best
                .as_ref()
                .is_none_or(|best| proposal.evidence() > best.evidence())
            {
                best = Some(proposal);
            }
        }
        best
    }

    fn try_curve(&self, joint: usize, curve: &Table) -> Option<CurveProposal> {
        let hypothesis = Hypothesis {
            effect: &UNKNOWN,
            place: Whereabouts {
                joint,
                ..Whereabouts::default()
            },
        };
        let free = curve.knots.len() - held_knots(curve, joint).len();
        if free == 0 {
            return None;
        }
        let at = |values: Vec<f64>| Active {
            hypothesis,
            coordinates: values,
            curve: Some(curve.clone()),
        };
        let columns: Vec<Column> = (0..free)
            .map(|k| {
                let mut values = vec![0.0; free];
                values[k] = 1.0;
                self.fit.added(self.problem, &at(values))
            })
            .collect();
        let minimum = vec![f64::NEG_INFINITY; free];
        let (values, gain, _) = self.try_columns(None, &columns, &minimum)?;
        Some(CurveProposal {
            active: at(values),
            gain,
            penalty: self.penalty(free, Some(joint)),
        })
    }
}

/// Sets the small values of a curve to zero: they are mostly noise, and beyond its ends a curve keeps its last value.
pub fn keep_what_is_evident(curve: &mut Active) {
    let largest = curve
        .coordinates
        .iter()
        .fold(0.0_f64, |most, x| most.max(x.abs()));
    for value in &mut curve.coordinates {
        if value.abs() < EVIDENT * largest {
            *value = 0.0;
        }
    }
}

/// Curves to try in a joint, with knots at even quantiles of the samples.
fn curves(problem: &Problem, joint: usize) -> Vec<Table> {
    let mut all = Vec::new();
    let mut add = |against: Against, of_joint: usize, count: usize| {
        let mut values = Vec::new();
        for track in &problem.tracks {
            track
                .track
                .each(|_, at: &MotionSample<'_>| values.push(against.value(at, of_joint)));
        }
        values.sort_by(f64::total_cmp);
        let last = values.len() - 1;
        let mut knots: Vec<f64> = (0..count).map(|k| values[last * k / (count - 1)]).collect();
        let least = LEAST_SPACING / count as f64 * (knots[count - 1] - knots[0]);
        knots.dedup_by(|later, earlier| *later - *earlier <= least);
        if knots.len() < LEAST_KNOTS {
            return;
        }
        // Friction jumps at standstill, so over the joint's own velocity only curves that change sign with the
        // direction of motion are tried.
        let own_velocity = against == Against::Velocity && of_joint == joint;
        let either: &[bool] = if own_velocity {
            &[true]
        } else {
            &[false, true]
        };
        for &by_direction in either {
            all.push(Table {
                against,
                of_joint,
                by_direction,
                period: None,
                values: vec![0.0; knots.len()],
                knots: knots.clone(),
            });
        }
    };
    for of_joint in 0..problem.joints {
        add(Against::Position, of_joint, KNOTS);
        add(Against::Velocity, of_joint, KNOTS);
    }
    add(Against::Position, joint, MANY_KNOTS);
    add(Against::Acceleration, joint, KNOTS);
    add(Against::Load, joint, KNOTS);
    add(Against::RecordingTime, joint, KNOTS);
    add(Against::SessionTime, joint, KNOTS);
    all
}

impl Base<'_> {
    /// Periodic curves in time at the frequency with the most power in the residual of a joint: one in phase over the
    /// whole session, one in phase from the start of each recording.
    fn repeated(&self, joint: usize) -> Vec<Table> {
        let of_session = self.problem.tracks.iter().map(|t| t.track.session_s);
        let start_s = of_session.clone().fold(f64::INFINITY, f64::min);
        let of = |against: Against| -> Option<Table> {
            let mut rows = Vec::new();
            for track in &self.problem.tracks {
                let shift = match against {
                    Against::SessionTime => track.track.session_s,
                    _ => 0.0,
                };
                for (row, &k) in track.rows().zip(&track.compared) {
                    let at = joint * self.problem.rows + row;
                    if self.problem.weight[at] > 0.0 {
                        rows.push((shift + track.track.time_s[k], self.fit.residual[at]));
                    }
                }
            }
            let first_s = rows.iter().map(|(t, _)| *t).fold(f64::INFINITY, f64::min);
            let last_s = rows.iter().map(|(t, _)| *t).fold(0.0, f64::max);
            let span_s = last_s - first_s;
            if !(span_s > 0.0 && span_s < LONGEST_IN_STEP_S) {
                return None;
            }
            // An effect that does not repeat within a recording is not seen to be periodic.
            let length_s = |track: &FitTrack| track.track.time_s.last().copied().unwrap_or(0.0);
            let longest_s = self.problem.tracks.iter().map(length_s).fold(0.0, f64::max);
            let least_hz = (LEAST_PERIODS / span_s).max(LEAST_IN_RECORDING / longest_s);
            let frequency_hz = loudest(&rows, [least_hz, self.problem.cutoff_hz])?;
            let period = 1.0 / frequency_hz;
            let knot = |k: usize| start_s + period * k as f64 / KNOTS_OF_PERIOD as f64;
            Some(Table {
                against,
                of_joint: joint,
                by_direction: false,
                period: Some(period),
                knots: (0..KNOTS_OF_PERIOD).map(knot).collect(),
                values: vec![0.0; KNOTS_OF_PERIOD],
            })
        };
        let both = [Against::SessionTime, Against::RecordingTime];
        both.into_iter().filter_map(of).collect()
    }
}

/// Frequency at which values at uneven times have the most power \[Hz\]: the Lomb-Scargle periodogram without its time
/// shift, which hardly matters with many periods.
fn loudest(rows: &[(f64, f64)], [lowest_hz, highest_hz]: [f64; 2]) -> Option<f64> {
    let last_s = rows
        .iter()
        .map(|(t, _)| *t)
        .fold(f64::NEG_INFINITY, f64::max);
    let first_s = rows.iter().map(|(t, _)| *t).fold(f64::INFINITY, f64::min);
    if last_s <= first_s {
        return None;
    }
    let step_hz = 1.0 / (STEPS_OF_FREQUENCY * (last_s - first_s));
    let power = |hz: f64| {
        let turn = std::f64::consts::TAU * hz;
        let (mut cosine, mut sine) = (0.0, 0.0);
        for (t, x) in rows {
            let (s, c) = (turn * t).sin_cos();
            cosine += c * x;
            sine += s * x;
        }
        cosine * cosine + sine * sine
    };
    let steps = ((highest_hz - lowest_hz) / step_hz).max(0.0) as usize;
    let grid = (0..=steps).map(|k| lowest_hz + step_hz * k as f64);
    let powers = grid.map(|hz| (hz, power(hz)));
    let (best, _) = powers.max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    // Between the grid steps the peak is interpolated by a parabola.
    let [before, at, after] = [best - step_hz, best, best + step_hz].map(power);
    let bend = before - 2.0 * at + after;
    let shift = if bend < 0.0 {
        0.5 * (before - after) / bend
    } else {
        0.0
    };
    Some(best + shift.clamp(-0.5, 0.5) * step_hz)
}

#[cfg(test)]
mod tests {
    use super::loudest;

    #[test]
    fn the_loudest_frequency_is_found_on_an_uneven_clock_with_gaps() {
        for hz in [0.31, 0.7858, 1.24, 3.3] {
            let rows: Vec<(f64, f64)> = (0..900)
                .map(|k| {
                    let k = f64::from(k);
                    // Three recordings, minutes apart, whose clocks jitter.
                    let gap = 40.0 * (k / 300.0).floor();
                    let t = 0.0625 * k + gap + 0.02 * (7.0 * k).sin();
                    let slow = 0.3 * (0.05 * t).cos();
                    (t, (std::f64::consts::TAU * hz * t + 0.4).sin() + slow)
                })
                .collect();
            let found = loudest(&rows, [0.1, 8.0]).unwrap();
            assert!((found - hz).abs() < 2e-4, "{found} Hz for {hz}");
        }
        assert!(loudest(&[(1.0, 2.0)], [0.1, 8.0]).is_none());
    }
}
