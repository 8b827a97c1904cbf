//! Check of a detector behind its twin, with its learnt state.

use std::path::Path;

use super::Resolver;
use crate::build;
use crate::learnt_state;
use crate::pipeline::role::Role;
use crate::settings::Settings;
use crate::yaml::Place;

impl Resolver<'_> {
    /// Checks a detector by building it, and resolves the path of its learnt state.
    pub(super) fn detect(
        &mut self,
        index: usize,
        place: &Place,
        config: &tauscope_detect::Config,
    ) -> Option<Settings> {
        let twin = self.above(index, |role| role == Role::Twin);
        let model = twin.and_then(|twin| self.models.get(&twin));
        let twin_config = twin.and_then(|twin| self.entry(twin).twin.as_ref());
        if twin_config.is_some_and(|twin| twin.model.is_some()) && model.is_none() {
            // The twin's model is invalid, which is already reported.
            return None;
        }
        let mut config = config.clone();
        let resolve = |path: &Path| self.file.resolve(path);
        if let Err(problems) = learnt_state::read_learnt(&mut config, &resolve) {
            self.report.append(problems);
            return None;
        }
        if let Some(path) = config.state_mut() {
            *path = self.file.resolve(path);
        }
        for (name, path) in config.trained_files_mut() {
            *path = self.file.resolve(path);
            if !path.exists() {
                let place = place.key(name).key("model");
                let title = format!("there is no trained detector {}", path.display());
                let problem = self.file.at(&place, title);
                let help = "`tauscope evaluate` trains one";
                self.report.push(problem.help(help));
                return None;
            }
        }
        let mut resumed = config.clone();
        if self.is_here(index)
            && let Err(problems) = learnt_state::resume(&mut resumed)
        {
            self.report.append(problems);
            return None;
        }
        if let Some(cell) = self.cell(index)
            && let Err(error) = build::detect(&resumed, model, cell, None)
        {
            self.report.push(self.file.at_key(place, error.to_string()));
            return None;
        }
        Some(Settings::Detect {
            config: Box::new(config),
            model: model.cloned(),
        })
    }
}
