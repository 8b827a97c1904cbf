//! Detectors against the labels of the test recordings: what tables, pages and files are made from.

use crate::evaluation::{Evaluation, Run};
use crate::metrics::{Matched, Numbers, Scored};
use crate::recording::Role;
use crate::runner::Runner;

/// A detector behind a twin, judged.
pub struct Judged<'a> {
    /// Which it is.
    pub run: &'a Run,
    /// What it goes by: the detector, and the twin where there are several.
    pub label: String,
    /// The labelled test recordings, of the first seed.
    pub scored: Vec<Scored<'a>>,
    /// Over all of them, by seed.
    pub numbers: Vec<Numbers>,
}

impl<'a> Judged<'a> {
    /// Of every detector behind every twin.
    pub fn all(evaluation: &'a Evaluation) -> Vec<Self> {
        let several = evaluation.twins.len() > 1;
        let judge = |run: &'a Run| {
            let name = run.first().entry.name;
            let label = if several {
                format!("{name} ({})", evaluation.twins[run.twin].name)
            } else {
                name.to_owned()
            };
            let numbers = run.seeds.iter().map(|runner| {
                let scored = test(evaluation, runner);
                Numbers::of(
                    &evaluation.request,
                    runner,
                    &scored.iter().collect::<Vec<_>>(),
                )
            });
            Self {
                run,
                label,
                scored: test(evaluation, run.first()),
                numbers: numbers.collect(),
            }
        };
        evaluation.runs.iter().map(judge).collect()
    }

    /// The numbers of the first seed.
    pub fn first(&self) -> &Numbers {
        &self.numbers[0]
    }

    /// Every true event of the test recordings, with what was said of it.
    pub fn matched(&self) -> impl Iterator<Item = Matched<'a>> {
        self.scored
            .iter()
            .flat_map(|one| one.matching.events.clone())
    }

    /// Whether it tells collisions from cooperations.
    pub fn tells_kinds(&self) -> bool {
        let outputs = &self.run.first().outputs;
        let mut events = outputs.iter().flat_map(|output| &output.events);
        events.any(|event| event.kind == "collision" || event.kind == "cooperation")
    }
}

impl Run {
    /// The first seed, whose files are written.
    pub fn first(&self) -> &Runner {
        &self.seeds[0]
    }
}

fn test<'a>(evaluation: &'a Evaluation, runner: &'a Runner) -> Vec<Scored<'a>> {
    let outputs = runner
        .outputs
        .iter()
        .filter(|output| output.role == Role::Test);
    let window = runner.window();
    outputs
        .filter_map(|output| Scored::of(&evaluation.request, output, window))
        .collect()
}
