//! The search for an arm that moves.

use tauscope_dynamics::effort_scale::EffortScale;
use tauscope_dynamics::terms::{PlaceKind, TermError};

use crate::context::Context;
use crate::data::problem::Problem;
use crate::data::remedies::{self, Remedy, Slip};
use crate::data::same_robot::Likeness;
use crate::explain::judged::{Judged, Stop};
use crate::fit::fitted::Fit;
use crate::inference::infer;
use crate::physics::active::{Active, Hypothesis};
use crate::physics::{library, torque_scale};
use crate::read::input::Method;
use crate::report::findings;
use crate::select::propose::penalty;
use crate::select::search::Search;

impl Context<'_> {
    /// Searches in motion alone, then with the standstills of the joints that have no set-valued friction.
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
        let hypotheses = self.hypotheses();
        let unnamed_bodies = if input.bodies {
            library::unnamed_bodies(&input.model, &input.without)
        } else {
            Vec::new()
        };
        // Unknown torque scales are fitted before the twin is compared.
        let scales = || torque_scale::unknown_scales(&self.unscaled);
        let say = |text: &str| {
            // The number of rounds is not known, so the share stays.
            progress(0.1, text);
        };
        let search = Search {
            problem: &problem,
            hypotheses: &hypotheses,
            unnamed_bodies: &unnamed_bodies,
            say: &say,
        };
        let (start, penalties) = started(&search, scales(), turn, input.bodies);
        if input.method == Method::Inference {
            return Ok(Ok(self.inferred(&search, start, scales())));
        }
        let moving = search.first_guess(start, penalties);
        // Without set-valued friction, standstills are as informative as motion.
        progress(0.3, "comparing standstills");
        let dry = (input.start.as_ref()).map_or_else(
            // Another simulation has friction of its own, and says nothing where the real one holds.
            || vec![!input.bodies; joints.len()],
            |start| start.is_dry(&input.model),
        );
        let rests_count: Vec<bool> = (0..joints.len())
            .map(|j| {
                let holds = |a: &Active| {
                    a.hypothesis.only_joint() == Some(j) && a.is_set_valued(&input.model)
                };
                !dry[j] && !moving.fit.actives.iter().any(holds)
            })
            .collect();
        let problem = if rests_count.contains(&true) {
            self.problem(&input.fit, &rests_count)?
        } else {
            problem
        };
        let search = Search {
            problem: &problem,
            hypotheses: &hypotheses,
            unnamed_bodies: &unnamed_bodies,
            say: &say,
        };
        let found = search.run(moving.fit.actives, moving.penalties);
        progress(0.8, "comparing alternative explanations");
        let before = Fit::new(&problem, scales()).refined(&problem);
        let named = findings::of(&search, &found, &before, self, &joints);
        let undetectable = findings::undetectable(&search, &found, self, &joints);
        Ok(Ok(Judged {
            before,
            found: found.fit,
            named,
            undetectable,
            rests_count,
            problem,
            remaining: None,
        }))
    }

    /// The explanation by inference.
    fn inferred(&self, search: &Search<'_>, start: Vec<Active>, scales: Vec<Active>) -> Judged {
        let problem = search.problem;
        let joints: Vec<String> = problem.model.joint_names().map(str::to_owned).collect();
        let hypotheses = [search.hypotheses, search.unnamed_bodies].concat();
        let inferred = infer(problem, &hypotheses, start, self.input.bodies, search.say);
        let before = Fit::new(problem, scales).refined(problem);
        let named = findings::of_inferred(search, &inferred, &before, self, &joints);
        // Predictions have the bodies' mean changes, too, which are too small for a finding.
        let mut actives = inferred.fit.actives;
        actives.extend(inferred.bodies);
        Judged {
            before,
            found: Fit::new(problem, actives),
            named,
            undetectable: Vec::new(),
            remaining: Some(inferred.remaining),
            rests_count: vec![false; joints.len()],
            problem: problem.clone(),
        }
    }

    /// The turn of the base that the efforts ask for, if any.
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
        // A scale of each joint is in doubt where one body explains the efforts as well.
        let scale = remedies::of_scale(input, &likeness.slopes);
        let scale = scale.filter(|slip| !slip.remedy.is_without(&input.without));
        let is_of_each = |slip: &Slip| slip.remedy.is_of_each_joint();
        let scale = scale.filter(|slip| !is_of_each(slip) || !remedies::is_one_body(problem));
        match audit.physics {
            Some(Remedy::BaseTurned(turn)) => return Ok(Some(turn)),
            Some(_) if !scale.as_ref().is_some_and(is_of_each) => return Ok(None),
            _ => {}
        }
        // A corrected twin was made of this robot, and in its unit.
        if input.start.is_some() {
            return Ok(None);
        }
        if let Some(reason) = likeness.of_another_robot() {
            return Err(Stop::Reason(reason));
        }
        match scale {
            Some(slip) => Err(Stop::Slips(vec![slip])),
            None => Ok(None),
        }
    }
}

/// The effects that a search starts from, with their penalties: a base that is turned so far that no search in small
/// steps would find it is one of them.
fn started(
    search: &Search<'_>,
    mut start: Vec<Active>,
    turn: Option<[f64; 2]>,
    bodies: bool,
) -> (Vec<Active>, Vec<f64>) {
    if !bodies {
        // The other simulation has friction of its own.
        let plain = search.hypotheses.iter().filter(|h| h.is_plain_friction());
        start.extend(plain.map(|h| h.with(vec![0.0])));
    }
    let mut penalties = vec![0.0; start.len()];
    let of_base = |h: &&Hypothesis| h.effect.place == PlaceKind::Base;
    if let (Some(turn), Some(tilt)) = (turn, search.hypotheses.iter().find(of_base)) {
        let nothing = Fit::new(search.problem, start.clone());
        let library = (search.hypotheses.len() as f64).ln();
        penalties.push(penalty(&nothing, library, turn.len(), None));
        start.push(tilt.with(turn.to_vec()));
    }
    (start, penalties)
}
