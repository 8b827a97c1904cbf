//! Detectors scored against the labels of the test recordings, as input of tables, pages and files.

use crate::evaluation::{Evaluation, Run};
use crate::metrics::{Matched, Numbers, Scored};
use crate::recording::Role;
use crate::runner::Runner;

/// A detector behind a twin, scored.
pub struct Judged<'a> {
    /// The detector, with all its seeds.
    pub run: &'a Run,
    /// Label: the detector, and the twin if there are several.
    pub label: String,
    /// Scores of the labelled test recordings, of the first seed.
    pub scored: Vec<Scored<'a>>,
    /// Figures over all of these recordings, by seed.
    pub numbers: Vec<Numbers>,
}

impl<'a> Judged<'a> {
    /// Scores every detector behind every twin.
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

    /// Figures of the first seed.
    pub fn first(&self) -> &Numbers {
        &self.numbers[0]
    }

    /// Every labelled event of the test recordings, with the detection that found it.
    pub fn matched(&self) -> impl Iterator<Item = Matched<'a>> {
        self.scored
            .iter()
            .flat_map(|one| one.matching.events.clone())
    }

    /// Whether it distinguishes collisions from cooperations.
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
