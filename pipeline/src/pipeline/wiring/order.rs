//! Topological order of the stages, and the cells of each one.

use std::collections::BTreeSet;

use super::{Checker, Input};
use crate::pipeline::stage::entry::stage_place;
use crate::pipeline::stage::role::{Role, Takes};
use crate::suggest;
use crate::yaml::Place;

impl Checker<'_> {
    /// Sorts the stages topologically; ties keep the order of the file.
    pub(super) fn order(&mut self, inputs: &[Vec<Input>]) -> Option<Vec<usize>> {
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
        // Every unplaced stage has an unplaced input, so following the inputs leads to a cycle.
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

    pub(super) fn cells(
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
                    .is_some_and(|role| matches!(role.takes, Takes::Nothing | Takes::AnyOne));
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
