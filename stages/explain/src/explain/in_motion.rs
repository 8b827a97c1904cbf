//! The search for an arm that moves.

use tauscope_dynamics::terms::TermError;

use crate::context::Context;
use crate::data::same_robot;
use crate::explain::judged::Judged;
use crate::fit::fitted::Fit;
use crate::physics::active::Active;
use crate::physics::{library, torque_scale};
use crate::report::findings;
use crate::select::search::Search;

impl Context<'_> {
    /// Searches in motion alone, then with the standstills of the joints that have no set-valued friction. Returns the
    /// reason if there is no verdict.
    pub fn in_motion(
        &self,
        progress: &(dyn Fn(f64, &str) + Sync),
    ) -> Result<Result<Judged, String>, TermError> {
        let input = self.input;
        let joints: Vec<String> = input.model.joint_names().map(str::to_owned).collect();
        let problem = self.problem(&input.fit, &vec![false; joints.len()])?;
        if let Some(reason) = same_robot::reason_against(input, &problem) {
            return Ok(Err(reason));
        }
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
        let penalties = vec![0.0; scales().len()];
        let moving = search.first_guess(scales(), penalties);
        // Without set-valued friction, standstills are as informative as motion.
        progress(0.3, "standstills");
        let dry = (input.start.as_ref()).map_or_else(
            || vec![false; joints.len()],
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
        progress(0.8, "rivals");
        let before = Fit::new(&problem, scales()).refined(&problem);
        let named = findings::of(&search, &found, &before, input, &joints);
        let undetectable = findings::undetectable(&search, &found, input, &joints);
        Ok(Ok(Judged {
            before,
            found: found.fit,
            named,
            undetectable,
            rests_count,
            problem,
        }))
    }
}
