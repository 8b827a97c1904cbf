//! The search for an arm at rest: temporary effects can be found, lasting ones cannot.

use tauscope_dynamics::terms::TermError;
use tauscope_dynamics::terms::words::number;

use crate::context::Context;
use crate::data::track::BEGINNING_S;
use crate::explain::judged::{Judged, Stop};
use crate::fit::fitted::Fit;
use crate::inference;
use crate::physics::active::{Hypothesis, TimeKind};
use crate::read::audit;
use crate::read::recording::Recording;
use crate::report::findings;

impl Context<'_> {
    /// Searches each recording by itself for temporary effects. Returns the reason if there is no verdict.
    pub fn at_rest(
        &self,
        progress: &(dyn Fn(f64, &str) + Sync),
    ) -> Result<Result<Judged, Stop>, TermError> {
        let input = self.input;
        let joints: Vec<String> = input.model.joint_names().map(str::to_owned).collect();
        let rests_count = vec![true; joints.len()];
        let mut hypotheses = self.hypotheses();
        // What is there through a whole recording, or longer, is part of its load.
        let passes = |h: &Hypothesis| {
            let stays = h.effect.traits.fills_recording || h.effect.traits.in_session;
            h.time_kind() == TimeKind::Once && !stays
        };
        hypotheses.retain(passes);
        progress(0.1, "looking for pushes");
        let (mut actives, mut undetectable) = (Vec::new(), Vec::new());
        let mut named = findings::Named::default();
        let known = |recording: &&Recording| !audit::is_frozen(recording, joints.len());
        for recording in input.fit.iter().filter(known) {
            let problem = self.problem(std::slice::from_ref(recording), &rests_count)?;
            let before = Fit::new(&problem, Vec::new());
            let say = |text: &str| progress(0.1, text);
            let inferred = inference::infer(&problem, &hypotheses, Vec::new(), input.bodies, &say);
            let mut own = findings::of(&problem, &inferred, &before, self, &joints);
            // No further motion tells more about a push that is over.
            own.next_motions.clear();
            own.trajectories.clear();
            named.extend(own);
            if undetectable.is_empty() {
                undetectable = findings::undetectable(&inferred.smallest, self, &joints);
            }
            actives.extend(inferred.fit.actives);
        }
        if named.findings.is_empty() {
            let reason =
                "no joint moves long or far enough: at rest, friction cannot be told from load";
            return Ok(Err(Stop::Reason(reason.to_owned())));
        }
        named.notes.push(format!(
            "No joint moves, so lasting effects cannot be told from the load at rest. The effort in the first {BEGINNING_S} s of each \
             recording, or until it changes, is taken as the usual load of that pose."
        ));
        if !self.unscaled.is_empty() {
            let of =
                |&(j, _): &(usize, f64)| format!("{} {} N m/A", joints[j], number(self.unit_nm[j]));
            let taken: Vec<String> = self.unscaled.iter().map(of).collect();
            named.notes.push(format!(
                "The torque constants of these drives are not known. Forces are only as right as these assumed values: {}.",
                taken.join(", ")
            ));
        }
        let problem = self.problem(&input.fit, &rests_count)?;
        Ok(Ok(Judged {
            before: Fit::new(&problem, Vec::new()),
            found: Fit::new(&problem, actives),
            named,
            undetectable,
            problem,
            kept: Vec::new(),
            remaining: Vec::new(),
        }))
    }
}
