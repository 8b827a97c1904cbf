//! Explanation of recordings in which the arm moves.

use tauscope_dynamics::effort_scale::EffortScale;
use tauscope_dynamics::terms::{PlaceKind, TermError};

use crate::context::Context;
use crate::data::problem::Problem;
use crate::data::remedies::{self, Remedy, Slip};
use crate::data::same_robot::Likeness;
use crate::explain::judged::{Judged, Stop};
use crate::fit::consistent_bodies::make_consistent;
use crate::fit::fitted::Fit;
use crate::fit::least_squares::weighted_dot;
use crate::inference;
use crate::physics::active::Active;
use crate::physics::{library, torque_scale};
use crate::report::findings;

impl Context<'_> {
    /// Infers the effects from the rows in motion. Rows at rest are excluded: static friction may have any value up
    /// to breakaway, so they contain little information about the other effects.
    pub fn in_motion(
        &self,
        progress: &(dyn Fn(f64, &str) + Sync),
    ) -> Result<Result<Judged, Stop>, TermError> {
        let input = self.input;
        let joints: Vec<String> = input.model.joint_names().map(str::to_owned).collect();
        let problem = self.problem(&input.fit, &vec![false; joints.len()])?;
        let turn = match self.remedied(&problem) {
            Ok(turn) => turn,
            Err(stop) => return Ok(Err(stop)),
        };
        let mut hypotheses = self.hypotheses();
        hypotheses.extend(library::unnamed(&input.model, input.bodies, &input.without));
        // Unknown torque scales are fitted before the twin is compared.
        let mut start = torque_scale::unknown_scales(&self.unscaled);
        // A large rotation of the base is a start value, because the local search would not find it.
        let tilt = (hypotheses.iter()).find(|h| h.effect.place == PlaceKind::Base);
        start.extend(tilt.zip(turn).map(|(tilt, turn)| tilt.with(turn.to_vec())));
        // The number of rounds is unknown, so the progress stays at 10 % during the inference.
        let say = |text: &str| progress(0.1, text);
        let inferred = inference::infer(&problem, &hypotheses, start, input.bodies, &say);
        progress(0.8, "wording the findings");
        let before = scaled(&problem, &self.unscaled);
        let named = findings::of(&problem, &inferred, &before, self, &joints);
        let undetectable = findings::undetectable(&inferred.smallest, self, &joints);
        // The corrected twin also contains the mean changes of the links, which are too small for a finding.
        let mut actives = inferred.fit.actives;
        if !named.findings.is_empty() {
            add_bodies(&mut actives, inferred.bodies);
            make_consistent(&problem.model, &mut actives);
        }
        Ok(Ok(Judged {
            before,
            found: Fit::new(&problem, actives),
            named,
            undetectable,
            remaining: inferred.remaining,
            kept: inferred.unpredictive,
            problem,
        }))
    }

    /// Returns the rotation of the base that the efforts require, if any, or the reason why they cannot be explained.
    fn remedied(&self, problem: &Problem) -> Result<Option<[f64; 2]>, Stop> {
        let input = self.input;
        if !input.bodies {
            return Ok(None);
        }
        let likeness = Likeness::of(problem);
        let slopes: Vec<f64> = likeness.slopes.iter().map(|(_, slope)| *slope).collect();
        let is_torque = EffortScale::of_positive(&slopes);
        let is_scaled = self.unscaled.is_empty() && matches!(is_torque, EffortScale::Torque { .. });
        let audit = remedies::audit(problem, is_scaled, &input.without);
        if !audit.slips.is_empty() {
            return Err(Stop::Slips(audit.slips));
        }
        // Separate scales of the joints are rejected if one wrong body explains the efforts as well.
        let scale = remedies::of_scale(input, &likeness.slopes);
        let scale = scale.filter(|slip| !slip.remedy.is_without(&input.without));
        let is_of_each = |slip: &Slip| slip.remedy.is_of_each_joint();
        let scale = scale.filter(|slip| !is_of_each(slip) || !remedies::is_one_body(problem));
        match audit.physics {
            Some(Remedy::BaseTurned(turn)) => return Ok(Some(turn)),
            Some(_) if !scale.as_ref().is_some_and(is_of_each) => return Ok(None),
            _ => {}
        }
        // A corrected twin was identified on this robot and in its unit, so neither can be wrong.
        if input.found_before().is_some() {
            return Ok(None);
        }
        if let Some(mut reason) = likeness.of_another_robot() {
            if let Some([x, y, z]) = remedies::turned_gravity(problem) {
                reason += &format!(
                    ", or its base is mounted otherwise: the efforts are nearest to those of gravity along ({x:.2}, {y:.2}, \
                     {z:.2}) in the base. Turn the first joint's <origin rpy> by that and try again"
                );
            }
            return Err(Stop::Reason(reason));
        }
        match scale {
            Some(slip) => Err(Stop::Slips(vec![slip])),
            None => Ok(None),
        }
    }
}

/// The twin with its unknown torque scales by least squares, none negative: recorded effort over that of the bodies.
fn scaled(problem: &Problem, first: &[(usize, f64)]) -> Fit {
    let fit = Fit::new(problem, torque_scale::unknown_scales(first));
    let mut actives = fit.actives.clone();
    for (active, column) in actives.iter_mut().zip(fit.jacobian(problem)) {
        let rows = problem.joint_rows(active.hypothesis.place.joint);
        let weight = &problem.weight[rows.clone()];
        let square = weighted_dot(weight, &column.values, &column.values);
        let product = weighted_dot(weight, &column.values, &fit.residual[rows]);
        let gain_minus_one = active.coordinates[0] + product / square.max(f64::MIN_POSITIVE);
        active.coordinates[0] = gain_minus_one.max(-1.0);
    }
    Fit::new(problem, actives)
}

/// Adds changes of bodies to effects: to the body that was found of a link, if there is one.
fn add_bodies(actives: &mut Vec<Active>, bodies: Vec<Active>) {
    for body in bodies {
        let known = actives.iter_mut().find(|a| a.hypothesis == body.hypothesis);
        let Some(known) = known else {
            actives.push(body);
            continue;
        };
        for (x, change) in known.coordinates.iter_mut().zip(body.coordinates) {
            *x += change;
        }
    }
}
