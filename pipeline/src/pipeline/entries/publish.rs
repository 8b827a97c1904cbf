//! Check of a publisher: it serves one cell and listens to the source to which it sends commands.

use std::path::PathBuf;

use tauscope_bus::{SampleKind, ZenohEndpoints};
use tauscope_publish::{Config, ConfigError};
use tauscope_record::FileName;

use super::Resolver;
use crate::pipeline::role::Role;
use crate::settings::{BesidePublisher, Settings};
use crate::yaml::Place;

impl Resolver<'_> {
    pub(super) fn publish(
        &mut self,
        index: usize,
        place: &Place,
        config: &Config,
    ) -> Option<Settings> {
        let wiring = self.wiring?;
        let one_cell = match wiring.cells[index].len() {
            1 => Ok(()),
            _ => Err(ConfigError::ManyCells),
        };
        let judges = |input: &usize| {
            wiring.roles[*input] != Role::Watch
                && wiring.roles[*input].gives() == Some(SampleKind::Detection)
        };
        let hears_detector = wiring.inputs[index].iter().any(judges);
        let heard = hears_detector.then_some(()).ok_or(ConfigError::NoDetector);
        if let Err(error) = config.check().and(one_cell).and(heard) {
            self.report.push(self.file.at_key(place, error.to_string()));
            return None;
        }
        let commands = self.commands(index);
        let hears_source = wiring.inputs[index]
            .iter()
            .any(|&input| wiring.roles[input].gives() == Some(SampleKind::JointState));
        if commands.is_some() && !hears_source {
            let title = "the source takes commands, but the publisher does not listen to it";
            let problem = self.file.at_key(place, title);
            self.report.push(problem.help(
                "commands come with the joint states: add the source to the publisher's `inputs`",
            ));
            return None;
        }
        Some(Settings::Publish {
            config: config.clone(),
            commands,
            beside: self.beside(index),
        })
    }

    /// The twin and the archive of the publisher's cell.
    fn beside(&self, index: usize) -> BesidePublisher {
        let Some(wiring) = self.wiring else {
            return BesidePublisher::default();
        };
        let cells = &wiring.cells[index];
        let stages = || 0..wiring.roles.len();
        let heard = wiring.inputs[index].iter().copied();
        let twin = heard
            .chain(stages().filter(|&at| wiring.cells[at] == *cells))
            .find(|&at| wiring.roles[at] == Role::Twin);
        let model = twin.and_then(|twin| self.models.get(&twin));
        let noise = model.iter().flat_map(|model| &model.joints);
        let writes = |at: usize| {
            let cell = (cells.iter()).find(|cell| wiring.cells[at].contains(*cell))?;
            let pattern = |path: &PathBuf| {
                let path = self.file.resolve(path);
                let path = std::path::absolute(&path).unwrap_or(path);
                Some(FileName::parse(&path).ok()?.pattern(cell))
            };
            let names = self.entry(at).record.as_ref()?.names_of_alarms();
            let patterns: Vec<String> = names.into_iter().filter_map(pattern).collect();
            (!patterns.is_empty()).then(|| patterns.join(", "))
        };
        BesidePublisher {
            twin_sha256: twin
                .and_then(|twin| self.model_sha256.get(&self.entry(twin).name))
                .cloned(),
            calibrated: noise
                .filter_map(|(name, joint)| Some((name.clone(), joint.noise?)))
                .collect(),
            archive: stages().find_map(writes),
        }
    }

    /// Command endpoints of the source of the stage's cell.
    fn commands(&self, index: usize) -> Option<ZenohEndpoints> {
        let wiring = self.wiring?;
        let cells = &wiring.cells[index];
        (0..wiring.roles.len())
            .filter(|&at| wiring.cells[at] == *cells)
            .find_map(|at| self.entry(at).ingest.as_ref()?.commands.clone())
    }
}
