//! What the corrected twin leaves beyond the noise, joint by joint, and what it goes with.
//!
//! The size of a remainder does not tell noise from physics: noise may be slow, and hundreds of times as large as its
//! fastest changes. So a remainder counts as physics by what noise cannot do:
//!
//! - it follows the motion, and a curve of that, or a sum over the last moments of it (`history.rs`), predicts it in
//!   recordings that it was not fitted on;
//! - it jumps where joints turn round (`remainder/turns.rs`), as friction does that comes and goes;
//! - it is far larger on held-out recordings than on fitted ones, although their efforts change no faster, or larger there
//!   than what the twin left before it was corrected;
//! - it stands out for moments;
//! - one recording does not go with the others (`remainder/odd_recording.rs`);
//! - one joint leaves far more than the others (`remainder/beside_others.rs`);
//! - more is missing while a joint stands than its friction holds (`remainder/standing.rs`).

mod beside_others;
mod follows;
mod held;
mod odd_recording;
mod standing;
mod turns;

use crate::context::Context;
use crate::data::noise::MEDIAN_OF_ABS_NORMAL;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::report::schema::{Finding, Remaining};
use crate::report::sentences::unit_at;
use crate::report::varying_delay::varying_delay;
use tauscope_dynamics::terms::TermError;
use tauscope_dynamics::terms::words::number;

use beside_others::{beside_others, is_alone};
use follows::follows_motion;
use held::of_held;
use odd_recording::odd_recording;

/// A moment stands out if its error is this many standard deviations of the calm half of the time.
/// Statistical: a normal variable exceeds 10 in none of 1e22 rows; slow noise is as normal as fast.
const STANDS_OUT: f64 = 10.0;
/// Fewer moments are the edges of an effect that acts once.
/// Physical: it has two, its beginning and its end.
const LEAST_MOMENTS: usize = 3;
/// Moments nearer than this are one \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const APART_S: f64 = 0.5;
/// Accelerations are uncertain within this time of either end of a recording \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const END_S: f64 = 0.25;
/// What no curve predicts is told from this many times the white noise on.
/// Tuned: as the note on what remains; clocks and smoothing leave less at reversals.
const LOUD: f64 = 5.0;
/// What remains is told from this many steps on in which the effort is told: a drive that tells in steps is not that exact
/// either, and friction is less the same from one start to the next.
/// Tuned: by hand, on 12 arms with friction, bodies that are off and no fault, of which 4 joints reach 0.9 to 3.6, and the
/// same with a fault, which begin at 8.3; not swept.
const LEAST_STEPS: f64 = 5.0;
/// Stamps may be wrong by at least this much \[s\].
/// Resolution: delays below this are not searched for.
const CLOCK_S: f64 = 0.002;

/// What a fit leaves in some recordings.
#[derive(Clone, Copy)]
struct Left<'a> {
    /// The recordings.
    problem: &'a Problem,
    /// The fit, evaluated there.
    fit: &'a Fit,
}

/// What the twin as it was leaves.
#[derive(Clone, Copy)]
struct Before<'a> {
    /// In the fitted recordings.
    fit: &'a Fit,
    /// In the held-out ones, if their effort is known.
    held: Option<&'a Fit>,
}

/// The remainders of an explanation.
#[derive(Debug, Default)]
pub struct Remainders {
    /// One or none per joint.
    pub all: Vec<Remaining>,
    /// Joints at which the error is much larger on held-out recordings.
    pub elsewhere: Vec<usize>,
    /// Names of the joints that leave several times what the others do on the fitted recordings, each in units of its noise.
    pub alone: Vec<String>,
    /// Whether the correction makes a joint's error on held-out recordings larger than the twin as it was leaves.
    pub is_worsened: bool,
}

impl Left<'_> {
    /// RMS error of a joint \[N m or N\].
    fn rms(&self, joint: usize) -> f64 {
        (self.fit.squares[joint] / self.fit.count[joint].max(1.0)).sqrt()
    }

    /// Whether a joint's error is one of few steps of its effort.
    fn is_within_steps(&self, joint: usize) -> bool {
        let step = self.problem.effort_step[joint];
        step.is_finite() && self.rms(joint) < LEAST_STEPS * step
    }

    /// Rows of a joint that count, with the rate at which the twin's effort changes there \[N m/s\].
    fn rows(&self, joint: usize) -> Vec<Row> {
        let problem = self.problem;
        let first = problem.joint_rows(joint).start;
        let rates = rates_of(problem, self.fit, joint);
        let row = |(recording, row, k): (usize, usize, usize)| Row {
            recording,
            time_s: problem.tracks[recording].track.time_s[k],
            error: self.fit.residual[first + row],
            rate: rates[row],
        };
        problem.counted(joint).map(row).collect()
    }

    /// The moment at which the error of a joint stands out most, if the error is one of moments.
    fn moment(&self, joint: usize) -> Option<Row> {
        let mut rows = self.rows(joint);
        let mut errors: Vec<f64> = rows.iter().map(|row| row.error.abs()).collect();
        errors.sort_by(f64::total_cmp);
        let calm = errors.get(errors.len() / 2)? / MEDIAN_OF_ABS_NORMAL;
        let calm = calm.max(self.problem.white_noise[joint]);
        let end_s = |row: &Row| {
            *self.problem.tracks[row.recording]
                .track
                .time_s
                .last()
                .unwrap_or(&0.0)
        };
        rows.retain(|row| row.time_s > END_S && row.time_s < end_s(row) - END_S);
        let clock_s = |row: &Row| clock_s(&self.problem.tracks[row.recording].track.time_s);
        let stands_out =
            |row: &&Row| row.error.abs() > STANDS_OUT * calm + clock_s(row) * row.rate.abs();
        let squares = |rows: &mut dyn Iterator<Item = &Row>| {
            rows.map(|row| row.error * row.error).sum::<f64>()
        };
        let all = squares(&mut rows.iter());
        let of_moments = squares(&mut rows.iter().filter(stands_out));
        let out: Vec<&Row> = rows.iter().filter(stands_out).collect();
        let apart = |pair: &&[&Row]| {
            let other = pair[0].recording != pair[1].recording;
            other || pair[1].time_s - pair[0].time_s > APART_S
        };
        let moments = out.windows(2).filter(apart).count() + usize::from(!out.is_empty());
        if moments < LEAST_MOMENTS || of_moments < 0.5 * all {
            return None;
        }
        let largest = out
            .into_iter()
            .max_by(|a, b| a.error.abs().total_cmp(&b.error.abs()));
        largest.cloned()
    }
}

/// A row of a joint that counts.
#[derive(Debug, Clone)]
struct Row {
    recording: usize,
    time_s: f64,
    error: f64,
    rate: f64,
}

/// By how much a stamp may be wrong \[s\]: a sample.
fn clock_s(time_s: &[f64]) -> f64 {
    let span_s = time_s.last().unwrap_or(&0.0) - time_s.first().unwrap_or(&0.0);
    (span_s / time_s.len().saturating_sub(1).max(1) as f64).max(CLOCK_S)
}

/// RMS error.
fn rms_error(rows: &[Row]) -> f64 {
    let squares: f64 = rows.iter().map(|row| row.error * row.error).sum();
    (squares / rows.len().max(1) as f64).sqrt()
}

/// RMS of the rate of change of effort.
fn rms_rate(rows: &[Row]) -> f64 {
    let squares: f64 = rows.iter().map(|row| row.rate * row.rate).sum();
    (squares / rows.len().max(1) as f64).sqrt()
}

impl Context<'_> {
    /// The remainders of the explanation `found`; those of an arm at rest are not judged.
    ///
    /// # Errors
    /// If a term of the start cannot be built for the robot.
    pub fn remainders(
        &self,
        (problem, fit): (&Problem, &Fit),
        before: &Fit,
        rests_count: &[bool],
        unit: &str,
        (after, findings): (&[f64], &[Finding]),
    ) -> Result<Remainders, TermError> {
        if self.at_rest {
            return Ok(Remainders::default());
        }
        let joints: Vec<String> = problem.model.joint_names().map(str::to_owned).collect();
        let held = self.held(rests_count, fit)?;
        let uncorrected = held
            .as_ref()
            .map(|(problem, _)| Fit::new(problem, before.actives.clone()));
        let held = held.as_ref().map(|(problem, fit)| Left { problem, fit });
        let found = Left { problem, fit };
        let before = Before {
            fit: before,
            held: uncorrected.as_ref(),
        };
        let mut remainders = of(found, before, held, self.unit_nm, &joints, unit);
        let alone = (0..joints.len()).filter(|&j| is_alone(found, j));
        remainders.alone = alone.map(|j| joints[j].clone()).collect();
        // Where nobody knows an effort's scale, friction in N m is no measure for it.
        if let Some(held) = held.filter(|_| self.input.bodies && self.unscaled.is_empty()) {
            remainders.add_standing(found, held, self.unit_nm, (after, findings), unit);
        }
        Ok(remainders)
    }
}

/// The remainders of the explanation `found` on the fitted recordings, and on `held` out ones if their effort is known.
/// `before` is the twin as it was; `unit_nm` turns the recordings' unit into N m, by joint.
fn of(
    found: Left<'_>,
    before: Before<'_>,
    held: Option<Left<'_>>,
    unit_nm: &[f64],
    joints: &[String],
    unit: &str,
) -> Remainders {
    let problem = found.problem;
    let mut remainders = Remainders::default();
    let late = varying_delay(problem, found.fit, &rates(problem, found.fit));
    let odd = odd_recording(found);
    for (j, joint) in joints.iter().enumerate() {
        let is_fine = |left: &Left<'_>| !left.is_within_steps(j);
        let (here, noise) = (found.rms(j), problem.white_noise[j]);
        let unit = unit_at(unit, &problem.model.joints()[j]);
        let told = |nm: f64| format!("{} {unit}", number(nm / unit_nm[j]));
        let there = held.as_ref().map(|held| held.rms(j));
        let odd = odd.as_ref().and_then(|odd| odd.says(j, joint, &told));
        let mut sentences: Vec<String> = odd.into_iter().collect();
        if sentences.is_empty()
            && is_fine(&found)
            && let Some(with) = follows_motion(found, before.fit, j)
        {
            sentences.push(format!(
                "{} remain at joint {joint}, and not as noise: {with}",
                told(here)
            ));
        }
        if let Some(late) = late.as_ref().filter(|late| late.joints.contains(&j)) {
            sentences.push(format!(
                "At joint {joint} {} remain as if the effort came early and late by {:.0} ms, at all joints at once: look at the \
                 recorder, the bus and their clocks.",
                told(here),
                1e3 * late.rms_s
            ));
        }
        let fine_held = held.filter(is_fine);
        if let Some(held) = fine_held {
            let told = (&told as &dyn Fn(f64) -> String, &joint[..]);
            let said = of_held(found, before, held, j, told);
            if said.is_elsewhere {
                remainders.elsewhere.push(j);
            }
            remainders.is_worsened |= said.is_worsened;
            sentences.extend(said.sentences);
        }
        if let Some((recording, moment)) =
            largest_moment([Some(found).filter(is_fine), fine_held], j)
        {
            sentences.push(format!(
                "At joint {joint} the error stands out for moments: {} in {recording} at {:.1} s, beside {} all the time. Look for a \
                 contact, a brake or a disturbance there.",
                told(moment.error.abs()),
                moment.time_s,
                told(here)
            ));
        }
        if sentences.is_empty()
            && is_fine(&found)
            && let Some(said) = beside_others(found, j, &told)
        {
            sentences.push(format!("{} remain at joint {joint}. {said}", told(here)));
        }
        if !sentences.is_empty() {
            remainders.all.push(Remaining {
                joint: joint.clone(),
                rms: here / unit_nm[j],
                holdout_rms: there.map(|there| there / unit_nm[j]),
                noise: noise / unit_nm[j],
                sentence: sentences.join(" "),
            });
        }
    }
    remainders
}

/// Rate of change of the twin's effort \[N m/s or N/s\], by joint and row.
pub(super) fn rates(problem: &Problem, fit: &Fit) -> Vec<Vec<f64>> {
    let joints = 0..problem.joints;
    joints.map(|joint| rates_of(problem, fit, joint)).collect()
}

fn rates_of(problem: &Problem, fit: &Fit, joint: usize) -> Vec<f64> {
    let first = problem.joint_rows(joint).start;
    let mut rates = vec![0.0; problem.rows];
    for track in &problem.tracks {
        let own: Vec<usize> = track.rows().collect();
        let time = |k: usize| track.track.time_s[track.compared[k]];
        let twin = |k: usize| problem.measured[first + own[k]] - fit.residual[first + own[k]];
        for k in 0..own.len() {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(own.len() - 1));
            let span_s = time(after) - time(before);
            if span_s > 0.0 {
                rates[own[k]] = (twin(after) - twin(before)) / span_s;
            }
        }
    }
    rates
}

/// The moment at which the error of a joint stands out most, and its recording.
fn largest_moment(all: [Option<Left<'_>>; 2], joint: usize) -> Option<(String, Row)> {
    let moments = all.into_iter().flatten().filter_map(|left| {
        let moment = left.moment(joint)?;
        let name = left.problem.tracks[moment.recording].track.name.clone();
        Some((name, moment))
    });
    moments.max_by(|(_, a), (_, b)| a.error.abs().total_cmp(&b.error.abs()))
}

#[cfg(test)]
mod tests;
