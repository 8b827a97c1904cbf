//! What the remainder of a joint goes with, if it follows the motion.

use tauscope_dynamics::terms::Against;
use tauscope_dynamics::{Data, mass_matrix};

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::report::history;
use crate::select::evidence::PATCH;
use crate::select::propose::Base;
use crate::select::prune::HIDDEN;

use super::turns::turns;
use super::{LOUD, Left, clock_s, rms_rate};

/// Share of that by which stamps are wrong as root mean square, where the error may follow the motion.
/// Statistical: a stamp anywhere within its sample is off by 0.29 of it.
const CLOCK_SHARE: f64 = 0.29;

/// In so many poses of a recording the arm's inertia is taken.
/// Resolution: it changes by less than a half within a motion.
const POSES: usize = 10;

/// A remainder that jumps where joints turn round is told from this share of its square that changes its sign there.
/// Tuned: as the share that a sum must predict; not swept.
const LEAST_OF_TURNS: f64 = 0.1;

/// What the remainder of a joint goes with, if it follows the motion.
pub(super) fn follows_motion(found: Left<'_>, before: &Fit, joint: usize) -> Option<String> {
    let (problem, fit) = (found.problem, found.fit);
    if fit.squares[joint] <= 0.0 || problem.tracks.len() < 2 {
        return None;
    }
    let names: Vec<String> = problem.model.joint_names().map(str::to_owned).collect();
    // What effects are known to do is not known to the last percent.
    let known = (before.squares[joint] - fit.squares[joint]).max(0.0);
    let hidden = HIDDEN * problem.unfiltered_noise[joint];
    let is_worth_telling = |share: f64| {
        let is_seen = share.sqrt() * found.rms(joint) >= hidden;
        is_seen && share * fit.squares[joint] >= PATCH * known
    };
    let told = |on: &str, by: &str, share: f64| {
        format!(
            "what remains depends on {on}, and {by} of that predicts {:.0} % of its square in recordings that it was not fitted on.",
            100.0 * share
        )
    };
    let curve = Base::new(problem, fit, 1).propose_curve(joint);
    let of_curve = curve.and_then(|curve| {
        let share = curve.carried.filter(|_| curve.repeats)?;
        let curve = curve.active.curve.as_ref()?;
        let is_of_acceleration = curve.against == Against::Acceleration;
        if is_of_acceleration && share.sqrt() * found.rms(joint) < encoder_cost(problem, joint) {
            return None;
        }
        let on = curve.depends_on(joint, &names);
        is_worth_telling(share).then(|| told(&on, "a curve", share))
    });
    let of_arm = !problem.is_foreign;
    let of_history = || {
        let history = history::predicts(problem, fit, joint, &names).filter(|_| of_arm)?;
        // Errors of clocks and derivatives follow the motion, too.
        let cost = clock_cost(found, joint).hypot(encoder_cost(problem, joint));
        let is_more =
            history.share.sqrt() * found.rms(joint) > cost.max(problem.white_noise[joint]);
        (is_more && is_worth_telling(history.share))
            .then(|| told(&history.on, "a sum", history.share))
    };
    let of_turns = || {
        let rms = found.rms(joint);
        let is_loud = of_arm && rms > LOUD * problem.white_noise[joint];
        let turns = is_loud.then(|| turns(found, joint, &names)).flatten()?;
        let share = (turns.half_jump / rms).powi(2).min(1.0);
        let is_told = share > LEAST_OF_TURNS && is_worth_telling(share);
        is_told.then(|| {
            format!(
                "{}: friction that comes and goes, play in the gear, or friction between two joints.",
                turns.at
            )
        })
    };
    of_curve.or_else(of_history).or_else(of_turns)
}

/// What the noise of recorded positions may leave at a joint, through the accelerations and the arm's inertia \[N m or N\]. It
/// goes with the accelerations, which have it, too: as in any regression on a variable that is measured with an error.
fn encoder_cost(problem: &Problem, joint: usize) -> f64 {
    let mut data = Data::new(&problem.model);
    let (mut squares, mut count) = (0.0, 0.0_f64);
    for track in &problem.tracks {
        let step = (track.track.len() / POSES).max(1);
        for q in track.track.position.chunks(problem.joints).step_by(step) {
            let mass = mass_matrix(&problem.model, &mut data, q);
            let of_other = |other: usize| mass[(joint, other)] * problem.acceleration_noise[other];
            squares += (0..problem.joints)
                .map(|other| of_other(other).powi(2))
                .sum::<f64>();
            count += 1.0;
        }
    }
    (squares / count.max(1.0)).sqrt()
}

/// What stamps that are wrong by a part of a sample may leave at a joint \[N m or N\].
pub(super) fn clock_cost(left: Left<'_>, joint: usize) -> f64 {
    let sample_s = clock_s(&left.problem.tracks[0].track.time_s);
    CLOCK_SHARE * sample_s * rms_rate(&left.rows(joint))
}
