//! Whether the data allows a verdict at all, and what a reader should know of it.

use crate::data::problem::{Problem, white_variance};
use crate::explain::Input;
use crate::fit::fitted::Fit;
use crate::read::recording::Recording;

/// Faster than this a joint counts as moving \[rad/s or m/s\].
const MOVES: f64 = 0.02;
/// A verdict needs a joint that moves for at least this long \[s\].
const LEAST_MOTION_S: f64 = 1.0;
/// And in some recording further than this: a push bends even an arm that holds still \[rad or m\].
const LEAST_RANGE: f64 = 0.05;
/// What is left stands out from this many times the white noise.
const LOUD: f64 = 5.0;
/// A joint's twin effort varies enough to compare with the measured one from this many times the noise.
const STRONG: f64 = 5.0;
/// A slope of measured effort over the twin's beyond this, either way, is a wrong unit rather than physics.
const WRONG_SCALE: f64 = 3.0;
/// A joint follows the twin if scaled it explains this share of what friction does not.
const FOLLOWS: f64 = 0.15;

/// Why nothing can be said, found before anything is fitted.
pub fn before(input: &Input) -> Option<String> {
    if let Some(recording) = input.fit.iter().find(|r| r.effort.is_empty()) {
        return Some(format!("recording {} holds no effort", recording.name));
    }
    if !input.bodies && input.fit.iter().any(|r| r.reference.is_empty()) {
        return Some("the twin is a topic, and a recording does not hold it".to_owned());
    }
    if input.fit.iter().all(|r| r.effort.iter().all(|x| *x == 0.0)) {
        return Some("the effort is zero throughout: the driver does not publish it".to_owned());
    }
    if let Some(recording) = input
        .fit
        .iter()
        .find(|r| r.len() < 50 || r.duration_s() < 1.0)
    {
        return Some(format!(
            "recording {} holds {} samples over {:.2} s, which is too short",
            recording.name,
            recording.len(),
            recording.duration_s()
        ));
    }
    if input.fit.len() + input.holdout.len() < 2 && input.start.is_none() && !at_rest(input) {
        return Some(
            "there is one recording only: what is fitted on it cannot be proved on another. Record the same arm \
             once more, with another motion, or start from a corrected twin"
                .to_owned(),
        );
    }
    None
}

/// Whether no joint moves for as long, or as far, as a verdict on what lasts needs.
pub fn at_rest(input: &Input) -> bool {
    let n = input.model.dof();
    let stays = |j: usize| input.fit.iter().all(|r| range(r, j, n) < LEAST_RANGE);
    (0..n).all(|j| moving_s(&input.fit, j, n) < LEAST_MOTION_S || stays(j))
}

/// Whether no position ever changes, not by an encoder's step: then nobody publishes them.
pub fn is_frozen(recording: &Recording, n: usize) -> bool {
    (0..n).all(|j| range(recording, j, n) <= 0.0)
}

/// How far a joint moves in a recording \[rad or m\].
fn range(recording: &Recording, joint: usize, n: usize) -> f64 {
    let positions = recording.position.iter().skip(joint).step_by(n);
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = positions.fold(ends, |(low, high), q| (low.min(*q), high.max(*q)));
    high - low
}

/// How long a joint moves \[s\].
fn moving_s(recordings: &[Recording], joint: usize, n: usize) -> f64 {
    let mut sum = 0.0;
    for recording in recordings {
        // Over a tenth of a second, so that the encoder's noise is no motion.
        let rate = recording.len() as f64 / recording.duration_s().max(1e-3);
        let reach = ((0.1 * rate) as usize).max(1);
        for k in reach..recording.len() {
            let change =
                recording.position[k * n + joint] - recording.position[(k - reach) * n + joint];
            let passed = recording.time_s[k] - recording.time_s[k - reach];
            if change.abs() > MOVES * passed {
                sum += recording.time_s[k] - recording.time_s[k - 1];
            }
        }
    }
    sum
}

/// Why nothing can be said, found by comparing the efforts as they are: a wrong robot, or a wrong unit.
pub fn of_problem(input: &Input, problem: &Problem) -> Option<String> {
    if !input.bodies || input.start.is_some() {
        return None;
    }
    let (mut strong, mut following, mut slopes) = (0, 0, Vec::new());
    for j in 0..problem.joints {
        let (share, slope, spread) = regression(problem, j);
        if spread < STRONG * problem.white_noise[j] {
            continue;
        }
        strong += 1;
        if share > FOLLOWS && slope > 0.0 {
            following += 1;
            slopes.push(slope);
        }
    }
    if strong == 0 {
        return None;
    }
    if 2 * following < strong || (strong >= 2 && following == 0) {
        return Some(format!(
            "the effort of {} of {strong} joints has nothing to do with what this robot's motion costs: it is the \
             recording of another robot, its joints have other signs, or gravity is taken off the effort",
            strong - following
        ));
    }
    slopes.sort_by(f64::total_cmp);
    let middle = slopes[slopes.len() / 2];
    let known_scale = input.effort_unit == "Nm" || input.torque_constants_nm_per_a.is_some();
    if known_scale && !(1.0 / WRONG_SCALE..=WRONG_SCALE).contains(&middle) {
        return Some(format!(
            "the measured effort is {middle:.2} times what this robot's motion costs: the unit or the torque \
             constants are wrong"
        ));
    }
    None
}

/// Share of a joint's measured variance that the twin's effort explains beside direction and speed, the slope, and
/// the standard deviation of the twin's effort \[N m\].
fn regression(problem: &Problem, joint: usize) -> (f64, f64, f64) {
    use nalgebra::{DMatrix, DVector};
    let rows = problem.joint_rows(joint);
    let n = problem.joints;
    let rigid: Vec<Vec<f64>> = problem
        .tracks
        .iter()
        .map(|t| t.track.rigid.clone())
        .collect();
    let mut model = vec![0.0; problem.rows];
    problem.joint_signal(&rigid, joint, &mut model);
    let (mut xs, mut ys) = (Vec::new(), Vec::new());
    for track in &problem.tracks {
        for (row, &k) in track.rows().zip(&track.compared) {
            if problem.weight[rows.start + row] > 0.0 {
                let velocity = track.track.velocity[k * n + joint];
                let sign = if velocity.abs() < MOVES {
                    0.0
                } else {
                    velocity.signum()
                };
                xs.push([1.0, sign, velocity, model[row]]);
                ys.push(problem.measured[rows.start + row]);
            }
        }
    }
    let m = ys.len();
    if m < 20 {
        return (1.0, 1.0, 0.0);
    }
    let mean = xs.iter().map(|x| x[3]).sum::<f64>() / m as f64;
    let spread = (xs.iter().map(|x| (x[3] - mean).powi(2)).sum::<f64>() / m as f64).sqrt();
    let y = DVector::from_vec(ys);
    let left = |columns: usize| {
        let x = DMatrix::from_fn(m, columns, |a, b| xs[a][b]);
        let mut normal = x.transpose() * &x;
        for a in 0..columns {
            normal[(a, a)] += 1e-9 * normal.trace() + 1e-12;
        }
        let solution = normal.cholesky().map(|c| c.solve(&(x.transpose() * &y)));
        let solution = solution.unwrap_or_else(|| DVector::zeros(columns));
        ((&y - &x * &solution).norm_squared(), solution[columns - 1])
    };
    let (without, _) = left(3);
    let (with, slope) = left(4);
    (1.0 - with / without.max(1e-300), slope, spread)
}

/// White noise of the measured effort of a joint \[effort unit\].
pub fn white_noise(recordings: &[Recording], joint: usize, n: usize) -> f64 {
    let mut all: Vec<f64> = recordings
        .iter()
        .map(|recording| {
            let signal: Vec<f64> = recording
                .effort
                .iter()
                .skip(joint)
                .step_by(n)
                .copied()
                .collect();
            white_variance(&signal).sqrt()
        })
        .collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
}

/// What was lost on reading, in words.
pub fn losses(input: &Input) -> Vec<String> {
    let mut notes = Vec::new();
    for recording in input.fit.iter().chain(&input.holdout) {
        let losses = &recording.losses;
        let mut parts = Vec::new();
        let mut add = |count: u64, what: &str| {
            if count > 0 {
                parts.push(format!("{count} {what}"));
            }
        };
        add(losses.repeated, "rows repeat a stamp");
        add(losses.not_finite, "rows are not finite and were dropped");
        add(
            losses.backward,
            "rows run backwards in time and were dropped",
        );
        add(losses.incomplete, "rows lack a joint and were dropped");
        add(losses.unreadable, "messages could not be read");
        add(
            losses.damaged,
            "parts of the file cannot be read, e.g. a torn tail",
        );
        if !parts.is_empty() {
            notes.push(format!("{}: {}.", recording.name, parts.join(", ")));
        }
    }
    notes
}

/// What else a reader should know; `found` is what was found on a problem.
pub fn notes(input: &Input, problem: &Problem, found: &Fit, rests_count: &[bool]) -> Vec<String> {
    let mut notes = losses(input);
    let names: Vec<&str> = input.model.joint_names().collect();
    for (j, name) in names.iter().enumerate() {
        let ratio = (found.variance[j].sqrt()) / problem.white_noise[j].max(1e-12);
        if ratio > LOUD {
            notes.push(format!(
                "What is left at joint {name} is {ratio:.0} times what the measurement's white noise leaves, and nothing explains it: \
                 slow noise, or something that is not in the library and does not depend on the joint's motion or on time alone."
            ));
        }
    }
    let stuck: Vec<&str> = names
        .iter()
        .zip(rests_count)
        .filter(|(_, counts)| !**counts)
        .map(|(name, _)| *name)
        .collect();
    if !stuck.is_empty() {
        notes.push(format!(
            "Standstill is set-valued: at rest the friction of {} takes any value up to breakaway, whatever the load \
             and the drive leave to it, and no function of the motion tells which. It was left out of the fit and is \
             not named as an effect; on the hold-out it counts.",
            stuck.join(", ")
        ));
    }
    notes
}
