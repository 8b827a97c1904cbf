//! A group of one stage, over open links.

use super::report::{Outcome, Report};
use super::tree::{Outlet, Post, Tree, Turn, branch};
use super::{Context, Ledger};
use crate::link::{Receiver, Sender};
use crate::sample::{Health, Sample};
use crate::stage::{Source, Stage};

/// Runs `source` into `output` until it ends or a stop is requested. After a failure its stream gets no end, so that
/// the source can be restarted.
pub fn run_source<T: Sample>(
    context: &Context,
    source: &mut dyn Source<T>,
    output: &mut dyn Sender<T>,
    health: &mut dyn Sender<Health>,
) -> Report {
    let out = Outlet::new(Vec::new(), Some(Box::new(output)));
    let post = post(context, "", health);
    run(
        context,
        Tree::of_source(&Turn::default(), post, Box::new(source), out),
    )
}

/// Runs `stage` from `input` to `output` until the input ends or a stop is requested.
///
/// On a stop request it first processes the samples that have arrived. After a failure its stream gets no end, so
/// that the stage can be restarted.
pub fn run_stage<I: Sample, O: Sample>(
    context: &Context,
    stage: &mut dyn Stage<I, O>,
    from: &str,
    input: &mut dyn Receiver<I>,
    output: &mut dyn Sender<O>,
    health: &mut dyn Sender<Health>,
) -> Report {
    let out = Outlet::new(Vec::new(), Some(Box::new(output)));
    let turn = Turn::default();
    let first = branch(&turn, post(context, from, health), Box::new(stage), out);
    let open = Box::new(move || Ok(Box::new(input) as Box<dyn Receiver<I>>));
    run(context, Tree::of_link(&turn, first, open))
}

fn post<'a>(context: &Context, from: &str, health: &'a mut dyn Sender<Health>) -> Post<'a> {
    Post {
        stage: context.stage.clone(),
        restarts: context.restarts,
        from: from.to_owned(),
        health: Box::new(health),
        ledger: Ledger::default(),
    }
}

fn run(context: &Context, mut tree: Tree<'_>) -> Report {
    if let Err(error) = tree.open() {
        return Report {
            stage: context.stage.clone(),
            outcome: Some(Outcome::of(&error.into())),
            ..Report::default()
        };
    }
    tree.run(context).pop().unwrap_or_default()
}
