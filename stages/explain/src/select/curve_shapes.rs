//! Curves over motion or time, for a residual that no effect of the library fits.

use nalgebra::Complex;
use tauscope_dynamics::terms::{Against, Table, UNKNOWN};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::data::track::FitTrack;
use crate::data::work::Work;
use crate::fit::fitted::Fit;
use crate::fit::least_squares::weighted_dot;
use crate::physics::active::{Active, Hypothesis, Whereabouts, held_knots};
use crate::select::carried::{BEYOND_CHANCE, Carried};
use crate::select::curve_axes::curves;
use crate::select::evidence::{FAIR_SHARE_OF_CURVE, LEAST_SIZE};
use crate::select::propose::Base;
use crate::select::spots::spots;

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
/// Products in turning a value by an angle and adding it.
/// Resolution: four multiplications, and as many additions.
const OF_TURN: usize = 4;
/// A periodic effect is not looked for over a longer time span, over which it would lose phase \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const LONGEST_IN_STEP_S: f64 = 1200.0;
/// Share of the residual's squares that a curve must predict in recordings left out.
/// Statistical: that of [`LEAST_SIZE`] in all that there was before.
const LEAST_CARRIED: f64 = LEAST_SIZE / (1.0 + LEAST_SIZE);
/// The same for a curve over the session.
/// Statistical: as [`FAIR_SHARE_OF_CURVE`], what no slow noise does.
const LEAST_OF_SESSION: f64 = 1.0 - 1.0 / FAIR_SHARE_OF_CURVE;
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
    /// Share of the residual's squares that it predicts in recordings that it was not fitted on. `None` if there is only
    /// one recording.
    pub carried: Option<f64>,
    /// Whether that share is larger than any curve would predict by chance, and worth mentioning.
    pub repeats: bool,
}

impl CurveProposal {
    /// Evidence for it \[nats\].
    pub fn evidence(&self) -> f64 {
        self.gain - self.penalty
    }

    /// Whether it may follow slow noise: a curve over time that does not repeat, although there are other recordings to
    /// show it, or one over the session that takes no fair share of the variance. The few recordings of a session may
    /// come in any order by chance.
    fn is_of_noise(&self) -> bool {
        let Some(curve) = self.active.curve.as_ref().filter(|c| c.period.is_none()) else {
            return false;
        };
        match curve.against {
            Against::RecordingTime => self.carried.is_some() && !self.repeats,
            Against::SessionTime => self.carried.is_none_or(|share| share < LEAST_OF_SESSION),
            _ => false,
        }
    }
}

impl Base<'_> {
    /// The curve that predicts most of the residual at a joint in recordings that it was not fitted on. If none predicts
    /// more than chance, the curve with the most evidence.
    pub fn propose_curve(&self, joint: usize) -> Option<CurveProposal> {
        let mut candidates = curves(self.problem, joint);
        candidates.extend(self.repeated(joint));
        candidates.extend(spots(self.problem, &self.fit.residual, joint));
        let count = candidates.len() as f64;
        let tried: Vec<(CurveProposal, Option<Carried>)> = candidates
            .iter()
            .filter_map(|curve| self.try_curve(joint, curve))
            .collect();
        let by_chance =
            Carried::largest_by_chance(tried.iter().filter_map(|(_, c)| c.as_ref()), BEYOND_CHANCE);
        let judged = tried.into_iter().map(|(mut proposal, carried)| {
            proposal.penalty += count.ln();
            let share = carried.map(|carried| carried.share);
            proposal.carried = share;
            proposal.repeats = share.is_some_and(|s| s > by_chance.max(LEAST_CARRIED));
            proposal
        });
        // Another simulation's errors are as slow as any curve.
        let is_seen = |p: &CurveProposal| p.repeats || !self.problem.is_foreign;
        let able = judged.filter(|proposal| !proposal.is_of_noise() && is_seen(proposal));
        able.max_by(|a, b| {
            let carried = |p: &CurveProposal| p.carried.filter(|_| p.repeats).unwrap_or(0.0);
            let by_share = carried(a).total_cmp(&carried(b));
            by_share.then(a.evidence().total_cmp(&b.evidence()))
        })
    }

    fn try_curve(&self, joint: usize, curve: &Table) -> Option<(CurveProposal, Option<Carried>)> {
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
        let columns = knot_columns(self.problem, self.fit, &at(vec![0.0; free]));
        let minimum = vec![f64::NEG_INFINITY; free];
        let (values, gain, _) = self.try_columns(None, &columns, &minimum)?;
        let proposal = CurveProposal {
            active: at(values),
            gain,
            penalty: self.penalty(free, Some(joint)),
            carried: None,
            repeats: false,
        };
        let carried = carried(self.problem, self.fit, curve, joint, &columns);
        Some((proposal, carried))
    }
}

/// The effort of a unit at each free knot of a curve, in addition to the effects of `fit`.
pub(crate) fn knot_columns(problem: &Problem, fit: &Fit, curve: &Active) -> Vec<Column> {
    let free = curve.coordinates.len();
    let unit = |k: usize| {
        let mut unit = curve.clone();
        unit.coordinates = (0..free)
            .map(|other| f64::from(u8::from(other == k)))
            .collect();
        fit.added(problem, &unit)
    };
    (0..free).map(unit).collect()
}

/// What a curve with these columns predicts of the residual of `fit` in recordings left out. A hysteresis of the load must
/// predict what a delay does not: both turn with the load's rate of change. A periodic curve is not judged, because its
/// period was chosen to suit all recordings.
fn carried(
    problem: &Problem,
    fit: &Fit,
    curve: &Table,
    joint: usize,
    columns: &[Column],
) -> Option<Carried> {
    if curve.period.is_some() {
        return None;
    }
    if curve.against != Against::LoadTurned {
        return Carried::of(problem, &fit.residual, joint, columns);
    }
    let rate = load_rate(problem, fit, joint);
    let own = problem.joint_rows(joint);
    let weight = &problem.weight[own.clone()];
    let product = |x: &[f64], y: &[f64]| weighted_dot(weight, x, y);
    let square = product(&rate, &rate).max(f64::MIN_POSITIVE);
    let less_delay = |values: &[f64]| -> Vec<f64> {
        let delay = product(values, &rate) / square;
        let each = values.iter().zip(&rate);
        each.map(|(value, rate)| value - delay * rate).collect()
    };
    let mut residual = fit.residual.clone();
    residual[own.clone()].copy_from_slice(&less_delay(&fit.residual[own]));
    let columns: Vec<Column> = (columns.iter())
        .map(|column| Column {
            joint: Some(joint),
            values: column
                .of_joint(joint, problem.rows)
                .map_or_else(|| vec![0.0; problem.rows], less_delay),
        })
        .collect();
    Carried::of(problem, &residual, joint, &columns)
}

/// Rate of change of the load of a joint, as a signal of the joint.
fn load_rate(problem: &Problem, fit: &Fit, joint: usize) -> Vec<f64> {
    let n = problem.joints;
    let load = fit.load(problem);
    let of_track = |(track, load): (&FitTrack, &Vec<f64>)| {
        let time = &track.track.time_s;
        let mut rate = vec![0.0; load.len()];
        for k in 1..time.len() {
            let step_s = time[k] - time[k - 1];
            let change = load[k * n + joint] - load[(k - 1) * n + joint];
            if step_s > 0.0 {
                rate[k * n + joint] = change / step_s;
            }
        }
        rate
    };
    let rates: Vec<Vec<f64>> = problem
        .tracks
        .iter()
        .zip(load.iter())
        .map(of_track)
        .collect();
    problem.column(&rates, Some(joint)).values
}

/// Whether a curve predicts what `without` leaves in recordings that it was not fitted on.
pub fn repeats(problem: &Problem, without: &Fit, curve: &Active) -> bool {
    let joint = curve.hypothesis.place.joint;
    let columns = knot_columns(problem, without, curve);
    let Some(table) = &curve.curve else {
        return false;
    };
    let carried = carried(problem, without, table, joint, &columns);
    carried.is_some_and(|carried| {
        let by_chance = Carried::largest_by_chance(std::iter::once(&carried), BEYOND_CHANCE);
        carried.share > by_chance.max(LEAST_CARRIED)
    })
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
            let frequency_hz = loudest(
                &rows,
                [least_hz, self.problem.cutoff_hz],
                &self.problem.work,
            )?;
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
fn loudest(rows: &[(f64, f64)], [lowest_hz, highest_hz]: [f64; 2], work: &Work) -> Option<f64> {
    let last_s = rows
        .iter()
        .map(|(t, _)| *t)
        .fold(f64::NEG_INFINITY, f64::max);
    let first_s = rows.iter().map(|(t, _)| *t).fold(f64::INFINITY, f64::min);
    if last_s <= first_s {
        return None;
    }
    let step_hz = 1.0 / (STEPS_OF_FREQUENCY * (last_s - first_s));
    let turned = move |hz: f64| {
        let turn = move |t: f64| Complex::from_polar(1.0, std::f64::consts::TAU * hz * t);
        rows.iter().map(move |&(t, x)| (turn(t), x))
    };
    // From one frequency of the grid to the next each value turns by the same angle.
    let mut values: Vec<Complex<f64>> = turned(lowest_hz).map(|(at, x)| at * x).collect();
    let steps_of_values: Vec<Complex<f64>> = turned(step_hz).map(|(step, _)| step).collect();
    let steps = ((highest_hz - lowest_hz) / step_hz).max(0.0) as usize;
    work.add_products(OF_TURN * steps * rows.len());
    let mut best = (lowest_hz, f64::NEG_INFINITY);
    for k in 0..=steps {
        let power = values.iter().sum::<Complex<f64>>().norm_sqr();
        if power >= best.1 {
            best = (lowest_hz + step_hz * k as f64, power);
        }
        for (value, step) in values.iter_mut().zip(&steps_of_values) {
            *value *= step;
        }
    }
    let (best, _) = best;
    let power = |hz: f64| {
        turned(hz)
            .map(|(at, x)| at * x)
            .sum::<Complex<f64>>()
            .norm_sqr()
    };
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
    use crate::data::work::Work;

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
            let found = loudest(&rows, [0.1, 8.0], &Work::default()).unwrap();
            assert!((found - hz).abs() < 2e-4, "{found} Hz for {hz}");
        }
        assert!(loudest(&[(1.0, 2.0)], [0.1, 8.0], &Work::default()).is_none());
    }
}
