//! Check that a twin's model was made for this robot and these filters.

use tauscope_twin::TwinFile;

use super::Resolver;
use crate::cell::Cell;
use crate::yaml::Place;

impl Resolver<'_> {
    /// Checks that the model was made for this robot and with these filters. Behind others its noise, and the
    /// thresholds based on its scores, are invalid.
    pub(super) fn model_fits(
        &mut self,
        place: &Place,
        config: &tauscope_twin::Config,
        model: &TwinFile,
        cell: &Cell,
    ) {
        if let Some(robot) = &cell.model
            && let Some(title) = model.made_for_other(robot.name())
        {
            let problem = self.file.at(&place.key("model"), title);
            self.report
                .push(problem.help("calibrate one for this robot: `tauscope calibrate`"));
        }
        if model.scores.is_empty() {
            return;
        }
        let mut own = model.joints.values().filter_map(|j| j.effort_cutoff_hz);
        if config.effort_cutoff_hz.is_some() && own.next().is_some() {
            let title = "`effort_cutoff_hz` is given, but the twin's model has low-passes by joint";
            let problem = self.file.at(&place.key("effort_cutoff_hz"), title);
            let help = "leave it out, or calibrate anew with --effort-cutoff-hz: its thresholds hold for no other";
            self.report.push(problem.help(help));
            return;
        }
        let cutoffs = [
            (
                "velocity_cutoff_hz",
                config.velocity_cutoff_hz,
                model.filters.velocity_cutoff_hz,
            ),
            (
                "effort_cutoff_hz",
                config.effort_cutoff_hz,
                model.filters.effort_cutoff_hz,
            ),
        ];
        for (key, here, there) in cutoffs {
            #[expect(
                clippy::float_cmp,
                reason = "both were written by people, not computed"
            )]
            let other = here.filter(|here| *here != there);
            if let Some(here) = other {
                let title =
                    format!("`{key}` is {here}, but the twin's model was made with {there}");
                let problem = self.file.at(&place.key(key), title);
                let help = format!(
                    "leave it out or give `{key}: {there}`, or calibrate anew: its thresholds hold for no other"
                );
                self.report.push(problem.help(help));
            }
        }
    }
}
