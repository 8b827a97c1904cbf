//! From a pipeline to what runs where: streams, links and the transports they take.

mod picture;
mod table;

use serde::Serialize;
use tauscope_bus::{Keep, SampleKind};
use tauscope_pipeline::pipeline::{Pipeline, Role, Stage};

pub use picture::{dot, mermaid};
pub use table::{keep_word, table};

/// What a link runs over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Over {
    /// Both ends are in one process, and the samples are handed over where they lie.
    InProcess,
    /// Both ends are on one host: iceoryx2.
    SharedMemory,
    /// The ends are on two hosts.
    Zenoh,
}

impl Over {
    /// In words.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::InProcess => "the process itself",
            Self::SharedMemory => "shared memory",
            Self::Zenoh => "Zenoh",
        }
    }
}

/// One stage listening to another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Link {
    /// The stage whose stream it is, by its place in [`Pipeline::stages`].
    pub from: usize,
    /// The stage that listens.
    pub to: usize,
    /// Name of the stream: `<cell>/<stage>`.
    pub stream: String,
    /// What it carries.
    pub carries: SampleKind,
    /// What it runs over.
    pub over: Over,
    /// What becomes of samples that the listener has no time for.
    pub keep: Keep,
}

/// All links of a pipeline, in the order of the stages that listen.
pub fn links(pipeline: &Pipeline) -> Vec<Link> {
    let mut links = Vec::new();
    for (to, stage) in pipeline.stages.iter().enumerate() {
        for &from in &stage.inputs {
            let maker = &pipeline.stages[from];
            let Some(carries) = maker.role.gives() else {
                continue;
            };
            let over = over(maker, stage);
            let keep = stage.keep;
            links.push(Link {
                from,
                to,
                stream: maker.stream(),
                carries,
                over,
                keep,
            });
        }
    }
    links
}

/// What a stage hears another over. One that takes no more than it has time for, or that may wait for a disk or a
/// network, is never called by the one it hears.
fn over(maker: &Stage, listener: &Stage) -> Over {
    let is_called = matches!(listener.role, Role::Twin | Role::Detect | Role::Explain)
        && listener.keep == Keep::All
        && !matches!(maker.role, Role::Outside(_));
    match (
        maker.host == listener.host,
        maker.process == listener.process,
    ) {
        (false, _) => Over::Zenoh,
        (true, true) if is_called => Over::InProcess,
        (true, _) => Over::SharedMemory,
    }
}

/// For each stage the first one of its tree: the source, or the stage that hears a link, from which it gets its samples
/// without leaving the process.
pub fn roots(pipeline: &Pipeline, links: &[Link]) -> Vec<usize> {
    let mut roots: Vec<usize> = (0..pipeline.stages.len()).collect();
    // Each stage comes after those it listens to.
    for at in 0..roots.len() {
        let above = links
            .iter()
            .find(|link| link.to == at && link.over == Over::InProcess);
        if let Some(link) = above {
            roots[at] = roots[link.from];
        }
    }
    roots
}
