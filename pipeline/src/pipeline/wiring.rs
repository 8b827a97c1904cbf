//! Graph of the stages and its validation.

mod endpoints;
mod inputs;
mod order;
mod processes;

use std::collections::{BTreeMap, BTreeSet};

use tauscope_bus::Name;

use super::file::PipelineFile;
use super::stage::entry::{StageEntry, stage_place};
use super::stage::role::Role;
use crate::report::Report;
use crate::suggest;
use crate::yaml::{Located, Place};

/// The graph of a pipeline; stages by index in the file.
#[derive(Debug)]
pub struct Wiring {
    /// Kind of each stage.
    pub roles: Vec<Role>,
    /// Inputs of each stage.
    pub inputs: Vec<Vec<usize>>,
    /// Topological order of the stages.
    pub order: Vec<usize>,
    /// Cells of each stage: one, except for a stage with several inputs.
    pub cells: Vec<BTreeSet<String>>,
    /// Host of each stage, if the file names hosts.
    pub hosts: Vec<Option<String>>,
    /// Process of each stage on its host.
    pub processes: Vec<String>,
}

/// Checks names, roles, inputs, cells and hosts; `None` if they are invalid. `kinds` are the keys that define the
/// kind of a stage.
pub fn check(file: &Located<PipelineFile>, kinds: &[&str], report: &mut Report) -> Option<Wiring> {
    let mut checker = Checker {
        file,
        stages: &file.value.stages,
        report,
        broken: false,
    };
    checker.names();
    let roles = checker.roles(kinds);
    let hosts = checker.hosts();
    checker.endpoints();
    let by_name = checker.stages_by_name();
    let inputs = checker.inputs(&roles, &by_name);
    checker.kinds(&roles, &inputs);
    let order = checker.order(&inputs);
    let cells = order
        .as_ref()
        .map(|order| checker.cells(&roles, &inputs, order));
    let processes = cells.as_ref().map(|cells| checker.processes(&roles, cells));
    if checker.broken {
        return None;
    }
    let inputs = inputs
        .into_iter()
        .map(|all| all.into_iter().map(|input| input.stage).collect());
    Some(Wiring {
        roles: roles.into_iter().collect::<Option<_>>()?,
        inputs: inputs.collect(),
        order: order?,
        cells: cells?,
        hosts,
        processes: processes?,
    })
}

/// An input of a stage.
struct Input {
    stage: usize,
    place: Place,
}

struct Checker<'a> {
    file: &'a Located<PipelineFile>,
    stages: &'a [StageEntry],
    report: &'a mut Report,
    broken: bool,
}

impl Checker<'_> {
    fn wrong(&mut self, problem: crate::report::Problem) {
        self.report.push(problem);
        self.broken = true;
    }

    /// Checks names: they become parts of bus keys and of entity paths, and must be unique.
    fn names(&mut self) {
        let top = Place::root();
        let cells = self
            .file
            .value
            .cells
            .keys()
            .map(|name| (name, top.key("cells").key(name), "cell"));
        let hosts = self
            .file
            .value
            .hosts
            .keys()
            .map(|name| (name, top.key("hosts").key(name), "host"));
        let stages = self.stages.iter().enumerate();
        let stages = stages.map(|(at, stage)| (&stage.name, stage_place(at).key("name"), "stage"));
        for (name, place, what) in cells.chain(hosts).chain(stages).collect::<Vec<_>>() {
            self.simple_name(name, &place, what);
        }
        if self.file.value.cells.is_empty() {
            let problem = self.file.at_key(&top.key("cells"), "there is no cell");
            self.wrong(problem.help("name one: `cells: {demo: {robot: robot.urdf}}`"));
        }
        let mut first: BTreeMap<&str, usize> = BTreeMap::new();
        for (index, stage) in self.stages.iter().enumerate() {
            let Some(&earlier) = first.get(stage.name.as_str()) else {
                first.insert(&stage.name, index);
                continue;
            };
            let place = stage_place(index).key("name");
            let problem = self
                .file
                .at(&place, format!("two stages are named `{}`", stage.name))
                .label("the second one")
                .also(
                    self.file.span(&stage_place(earlier).key("name")),
                    "the first one",
                );
            self.wrong(problem);
        }
    }

    fn simple_name(&mut self, name: &str, place: &Place, what: &str) {
        let simple = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if name.is_empty() || !name.chars().all(simple) {
            let title = format!("`{name}` cannot be a {what}'s name");
            let problem = match what {
                "stage" | "process" => self.file.at(place, title),
                _ => self.file.at_key(place, title),
            };
            self.wrong(problem.help("a name is made of letters, digits, `_` and `-`"));
        } else if name.len() > Name::CAPACITY {
            let title = format!(
                "the name is {} bytes long, at most {} fit",
                name.len(),
                Name::CAPACITY
            );
            self.wrong(self.file.at(place, title));
        }
    }

    fn roles(&mut self, kinds: &[&str]) -> Vec<Option<Role>> {
        let mut roles = Vec::new();
        for (index, stage) in self.stages.iter().enumerate() {
            let place = stage_place(index);
            match stage.parts.as_slice() {
                [part] => {
                    roles.push(Some(part.config.role()));
                    continue;
                }
                [] => {
                    let title = format!("stage `{}` does not say what it is", stage.name);
                    let keys = suggest::list(kinds.iter().copied());
                    self.wrong(
                        self.file
                            .at(&place, title)
                            .help(format!("give one of {keys}")),
                    );
                }
                [first, second, ..] => {
                    let (first, second) = (first.key, second.key);
                    let title = format!("stage `{}` is two things at once", stage.name);
                    let problem = self
                        .file
                        .at_key(&place.key(second), title)
                        .label(format!("`{second}`"))
                        .also(self.file.key_span(&place.key(first)), format!("`{first}`"))
                        .help("make two stages of it");
                    self.wrong(problem);
                }
            }
            roles.push(None);
        }
        roles
    }

    fn hosts(&mut self) -> Vec<Option<String>> {
        let known = &self.file.value.hosts;
        let only = (known.len() == 1)
            .then(|| known.keys().next().cloned())
            .flatten();
        let mut hosts = Vec::new();
        for (index, stage) in self.stages.iter().enumerate() {
            let place = stage_place(index);
            match &stage.host {
                Some(host) if !known.contains_key(host) => {
                    let names = known.keys().map(String::as_str);
                    let help = suggest::help(host, "the hosts are", names)
                        .unwrap_or_else(|| "name it under `hosts`".to_owned());
                    let title = format!("there is no host `{host}`");
                    self.wrong(self.file.at(&place.key("host"), title).help(help));
                }
                None if known.len() > 1 => {
                    let title =
                        format!("stage `{}` does not say on which host it runs", stage.name);
                    let names = suggest::list(known.keys().map(String::as_str));
                    let problem = self.file.at(&place.key("name"), title);
                    self.wrong(problem.help(format!("give `host`, one of {names}")));
                }
                _ => {}
            }
            hosts.push(stage.host.clone().or_else(|| only.clone()));
        }
        hosts
    }
}
