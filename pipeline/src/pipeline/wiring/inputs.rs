//! Check of each stage's inputs: their number, their names, and their sample types.

use std::collections::BTreeMap;

use super::{Checker, Input};
use crate::pipeline::stage::entry::stage_place;
use crate::pipeline::stage::role::{Role, Takes, makers_of, words_for};
use crate::suggest;
use crate::yaml::Place;

impl<'a> Checker<'a> {
    /// Index of the first stage of each name.
    pub(super) fn stages_by_name(&self) -> BTreeMap<&'a str, usize> {
        let mut by_name = BTreeMap::new();
        for (index, stage) in self.stages.iter().enumerate() {
            by_name.entry(stage.name.as_str()).or_insert(index);
        }
        by_name
    }

    pub(super) fn inputs(
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
        let key = role.kind.key;
        if stage.input.is_some() && stage.inputs.is_some() {
            let problem = self
                .file
                .at_key(&place.key("inputs"), "give `input` or `inputs`, not both")
                .also(self.file.key_span(&place.key("input")), "`input`");
            self.wrong(problem);
            return;
        }
        let problem = match (role.takes, named) {
            (Takes::Nothing, [(_, first), ..]) => {
                let title = format!("an `{key}` stage is a source and takes no input");
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

    pub(super) fn kinds(&mut self, roles: &[Option<Role>], inputs: &[Vec<Input>]) {
        for (index, inputs) in inputs.iter().enumerate() {
            let Some(role) = roles[index] else { continue };
            for input in inputs {
                let Some(maker) = roles[input.stage] else {
                    continue;
                };
                let name = &self.stages[input.stage].name;
                let Some(given) = maker.gives else {
                    let title = format!("`{name}` has no output stream to listen to");
                    self.wrong(self.file.at(&input.place, title));
                    continue;
                };
                let Takes::One(wanted) = role.takes else {
                    continue;
                };
                if given != wanted {
                    let key = role.kind.key;
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
}
