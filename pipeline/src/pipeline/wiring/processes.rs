//! Process of each stage.

use std::collections::BTreeSet;

use super::Checker;
use crate::pipeline::stage::entry::stage_place;
use crate::pipeline::stage::role::{Placement, Role};
use crate::yaml::Place;

impl Checker<'_> {
    /// Assigns a process to each stage. By default the stages that judge a cell share one process, so that no alarm
    /// waits for another process. A recorder or a publisher, which may wait for a disk or a network, has its own.
    pub(super) fn processes(
        &mut self,
        roles: &[Option<Role>],
        cells: &[BTreeSet<String>],
    ) -> Vec<String> {
        self.process_names(roles);
        let file = &self.file.value;
        let shared = |index: usize| {
            let cell = cells[index].first()?;
            let named = file.cells.get(cell)?.process.as_ref();
            Some(named.or(file.process.as_ref()).unwrap_or(cell).clone())
        };
        let joins = |role: Option<Role>| {
            role.is_some_and(|role| role.kind.placement == Placement::WithCell)
        };
        let named: Vec<Option<String>> = (self.stages.iter().zip(roles).enumerate())
            .map(|(index, (stage, role))| {
                let inherited = || shared(index).filter(|_| joins(*role));
                stage.process.clone().or_else(inherited)
            })
            .collect();
        let taken: BTreeSet<&String> = named.iter().flatten().collect();
        let alone = (self.stages.iter().zip(roles)).map(|(stage, role)| {
            let key = role.map_or("stage", |role| role.kind.key);
            if taken.contains(&stage.name) {
                format!("{}_{key}", stage.name)
            } else {
                stage.name.clone()
            }
        });
        let names = named.iter().zip(alone);
        names
            .map(|(named, alone)| named.clone().unwrap_or(alone))
            .collect()
    }

    fn process_names(&mut self, roles: &[Option<Role>]) {
        let top = Place::root();
        let file = &self.file.value;
        let all = file.process.iter().map(|name| (name, top.key("process")));
        let cells = file.cells.iter().filter_map(|(cell, entry)| {
            let place = top.key("cells").key(cell).key("process");
            Some((entry.process.as_ref()?, place))
        });
        let stages = self.stages.iter().enumerate().filter_map(|(index, stage)| {
            Some((stage.process.as_ref()?, stage_place(index).key("process")))
        });
        for (name, place) in all.chain(cells).chain(stages).collect::<Vec<_>>() {
            self.simple_name(name, &place, "process");
        }
        for (index, stage) in self.stages.iter().enumerate() {
            let is_program =
                roles[index].is_some_and(|role| role.kind.placement == Placement::Program);
            if stage.process.is_some() && is_program {
                let place = stage_place(index).key("process");
                let title = format!("`{}` is a program, which is a process itself", stage.name);
                let problem = self.file.at_key(&place, title);
                self.wrong(problem.help("leave `process` out"));
            }
        }
    }
}
