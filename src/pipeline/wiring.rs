//! Who listens to whom, and whether that makes a pipeline.

use std::collections::{BTreeMap, BTreeSet};

use tauscope_bus::Name;

use super::file::{PipelineFile, StageEntry};
use super::role::{ROLE_KEYS, Role, Takes, makers_of, words_for};
use super::stage_place;
use crate::report::Report;
use crate::suggest;
use crate::yaml::{Located, Place};

/// The graph of a pipeline; stages by their place in the file.
#[derive(Debug)]
pub struct Wiring {
    /// What each stage is.
    pub roles: Vec<Role>,
    /// What each stage listens to.
    pub inputs: Vec<Vec<usize>>,
    /// All stages, each after those it listens to.
    pub order: Vec<usize>,
    /// The cells each stage belongs to: one, but for a stage that takes many streams.
    pub cells: Vec<BTreeSet<String>>,
    /// The host each stage runs on, where the file names hosts.
    pub hosts: Vec<Option<String>>,
}

/// Checks names, roles, inputs, cells and hosts; `None` if they make no pipeline.
pub fn check(file: &Located<PipelineFile>, report: &mut Report) -> Option<Wiring> {
    let mut checker = Checker {
        file,
        stages: &file.value.stages,
        report,
        broken: false,
    };
    checker.names();
    let roles = checker.roles();
    let hosts = checker.hosts();
    let by_name = checker.stages_by_name();
    let inputs = checker.inputs(&roles, &by_name);
    checker.kinds(&roles, &inputs);
    let order = checker.order(&inputs);
    let cells = order
        .as_ref()
        .map(|order| checker.cells(&roles, &inputs, order));
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
    })
}

/// One thing that a stage listens to.
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

impl<'a> Checker<'a> {
    fn wrong(&mut self, problem: crate::report::Problem) {
        self.report.push(problem);
        self.broken = true;
    }

    /// Names become parts of keys on the bus and of entity paths, and must be told apart.
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
            let simple = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
            if name.is_empty() || !name.chars().all(simple) {
                let problem = match what {
                    "stage" => self
                        .file
                        .at(&place, format!("`{name}` cannot be a {what}'s name")),
                    _ => self
                        .file
                        .at_key(&place, format!("`{name}` cannot be a {what}'s name")),
                };
                self.wrong(problem.help("a name is made of letters, digits, `_` and `-`"));
            } else if name.len() > Name::CAPACITY {
                let title = format!(
                    "the name is {} bytes long, at most {} fit",
                    name.len(),
                    Name::CAPACITY
                );
                self.wrong(self.file.at(&place, title));
            }
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

    fn roles(&mut self) -> Vec<Option<Role>> {
        let mut roles = Vec::new();
        for (index, stage) in self.stages.iter().enumerate() {
            let place = stage_place(index);
            let claimed = Role::claimed(stage);
            match claimed.as_slice() {
                [(_, role)] => {
                    roles.push(Some(*role));
                    continue;
                }
                [] => {
                    let title = format!("stage `{}` does not say what it is", stage.name);
                    let keys = suggest::list(ROLE_KEYS);
                    self.wrong(
                        self.file
                            .at(&place, title)
                            .help(format!("give one of {keys}")),
                    );
                }
                [(first, _), (second, _), ..] => {
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

    /// The first stage of each name.
    fn stages_by_name(&self) -> BTreeMap<&'a str, usize> {
        let mut by_name = BTreeMap::new();
        for (index, stage) in self.stages.iter().enumerate() {
            by_name.entry(stage.name.as_str()).or_insert(index);
        }
        by_name
    }

    fn inputs(
        &mut self,
        roles: &[Option<Role>],
        by_name: &BTreeMap<&'a str, usize>,
    ) -> Vec<Vec<Input>> {
        let mut all = Vec::new();
        for (index, stage) in self.stages.iter().enumerate() {
            let place = stage_place(index);
            let mut named: Vec<(&'a str, Place)> = Vec::new();
            named.extend(
                stage
                    .input
                    .as_deref()
                    .map(|name| (name, place.key("input"))),
            );
            let list = stage.inputs.iter().flatten().enumerate();
            named.extend(list.map(|(at, name)| (name.as_str(), place.key("inputs").index(at))));
            if let Some(role) = roles[index] {
                self.number_of_inputs(index, role, &named);
            }
            let mut inputs: Vec<Input> = Vec::new();
            for (name, place) in named {
                let Some(&from) = by_name.get(name) else {
                    let others = by_name.keys().copied().filter(|&other| other != stage.name);
                    let help = suggest::help(name, "the other stages are", others);
                    let title = format!("there is no stage `{name}`");
                    self.wrong(self.file.at(&place, title).maybe_help(help));
                    continue;
                };
                if let Some(earlier) = inputs.iter().find(|input| input.stage == from) {
                    let problem = self
                        .file
                        .at(
                            &place,
                            format!("`{}` listens to `{name}` twice", stage.name),
                        )
                        .also(self.file.span(&earlier.place), "already here");
                    self.wrong(problem);
                    continue;
                }
                inputs.push(Input { stage: from, place });
            }
            all.push(inputs);
        }
        all
    }

    fn number_of_inputs(&mut self, index: usize, role: Role, named: &[(&str, Place)]) {
        let stage = &self.stages[index];
        let place = stage_place(index);
        let key = role.key();
        if stage.input.is_some() && stage.inputs.is_some() {
            let problem = self
                .file
                .at_key(&place.key("inputs"), "give `input` or `inputs`, not both")
                .also(self.file.key_span(&place.key("input")), "`input`");
            self.wrong(problem);
            return;
        }
        let problem = match (role.takes(), named) {
            (Takes::Nothing, [(_, first), ..]) => {
                let title = format!("an `{key}` stage is a source and listens to nobody");
                self.file.at(first, title)
            }
            (Takes::One(kind), []) => {
                let title = format!("stage `{}` has no `input`", stage.name);
                let maker = makers_of(kind);
                self.file.at(&place.key("name"), title).help(format!(
                    "a `{key}` stage listens to {maker}: `input: <name>`"
                ))
            }
            (Takes::Many, []) => {
                let title = format!("stage `{}` has no `inputs`", stage.name);
                self.file
                    .at(&place.key("name"), title)
                    .help("name the stages it listens to: `inputs: [<name>, <name>]`")
            }
            (Takes::One(_) | Takes::AnyOne, [_, (_, second), ..]) => {
                let title = format!("stage `{}` can listen to one stage only", stage.name);
                self.file
                    .at(second, title)
                    .help("make a stage for each, under names of their own")
            }
            _ => return,
        };
        self.wrong(problem);
    }

    fn kinds(&mut self, roles: &[Option<Role>], inputs: &[Vec<Input>]) {
        for (index, inputs) in inputs.iter().enumerate() {
            let Some(role) = roles[index] else { continue };
            for input in inputs {
                let Some(maker) = roles[input.stage] else {
                    continue;
                };
                let name = &self.stages[input.stage].name;
                let Some(given) = maker.gives() else {
                    let title = format!("`{name}` puts out nothing that one could listen to");
                    self.wrong(self.file.at(&input.place, title));
                    continue;
                };
                let Takes::One(wanted) = role.takes() else {
                    continue;
                };
                if given != wanted {
                    let key = role.key();
                    let title = format!(
                        "a `{key}` stage takes {}, but `{name}` puts out {}",
                        words_for(wanted),
                        words_for(given)
                    );
                    let help = format!("let it listen to {}", makers_of(wanted));
                    self.wrong(self.file.at(&input.place, title).help(help));
                }
            }
        }
    }

    /// Stages after all they listen to, in the file's order where that leaves a choice.
    fn order(&mut self, inputs: &[Vec<Input>]) -> Option<Vec<usize>> {
        let mut order = Vec::new();
        let mut placed = vec![false; inputs.len()];
        while let Some(next) = (0..inputs.len())
            .find(|&at| !placed[at] && inputs[at].iter().all(|input| placed[input.stage]))
        {
            placed[next] = true;
            order.push(next);
        }
        if order.len() == inputs.len() {
            return Some(order);
        }
        // Every stage left listens to one that is left: following those ends in a cycle.
        let mut trail: Vec<(usize, &Place)> = Vec::new();
        let mut at = placed.iter().position(|done| !done)?;
        while !trail.iter().any(|(seen, _)| *seen == at) {
            let input = inputs[at].iter().find(|input| !placed[input.stage])?;
            trail.push((at, &input.place));
            at = input.stage;
        }
        let begin = trail.iter().position(|(seen, _)| *seen == at)?;
        let cycle = &trail[begin..];
        let mut names: Vec<&str> = cycle
            .iter()
            .rev()
            .map(|(at, _)| self.stages[*at].name.as_str())
            .collect();
        names.insert(0, self.stages[at].name.as_str());
        let mut problem = self.file.at(
            cycle[0].1,
            format!("the stages run in a circle: {}", names.join(" -> ")),
        );
        for (_, place) in &cycle[1..] {
            problem = problem.also(self.file.span(place), "and here");
        }
        self.wrong(
            problem.help("a pipeline has a beginning: a stage cannot listen to what it causes"),
        );
        None
    }

    fn cells(
        &mut self,
        roles: &[Option<Role>],
        inputs: &[Vec<Input>],
        order: &[usize],
    ) -> Vec<BTreeSet<String>> {
        let known = &self.file.value.cells;
        let only = (known.len() == 1)
            .then(|| known.keys().next().cloned())
            .flatten();
        let mut cells = vec![BTreeSet::new(); inputs.len()];
        for &index in order {
            let stage = &self.stages[index];
            let place = stage_place(index);
            let inherited: BTreeSet<String> = inputs[index]
                .iter()
                .flat_map(|input| cells[input.stage].clone())
                .collect();
            if let Some(cell) = &stage.cell {
                if !known.contains_key(cell) {
                    let help =
                        suggest::help(cell, "the cells are", known.keys().map(String::as_str));
                    let title = format!("there is no cell `{cell}`");
                    self.wrong(self.file.at(&place.key("cell"), title).maybe_help(help));
                } else if let Some(other) = inherited.iter().find(|other| *other != cell) {
                    let title = format!(
                        "stage `{}` listens to cell `{other}` and cannot be in cell `{cell}`",
                        stage.name
                    );
                    let problem = self.file.at(&place.key("cell"), title);
                    self.wrong(problem.help("leave `cell` out: it is that of the input"));
                }
            }
            let is_source = stage.input.is_none()
                && roles[index]
                    .is_some_and(|role| matches!(role.takes(), Takes::Nothing | Takes::AnyOne));
            if is_source && stage.cell.is_none() && only.is_none() {
                let title = format!(
                    "stage `{}` does not say which cell it belongs to",
                    stage.name
                );
                let names = suggest::list(known.keys().map(String::as_str));
                let problem = self.file.at(&place.key("name"), title);
                self.wrong(problem.help(format!("give `cell`, one of {names}")));
            }
            cells[index] = match &stage.cell {
                Some(cell) => BTreeSet::from([cell.clone()]),
                None if is_source => only.iter().cloned().collect(),
                None => inherited,
            };
        }
        cells
    }
}
