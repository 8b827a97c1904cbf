//! The plan of a pipeline: its streams, its links and their transports.

mod picture;
mod table;

use serde::Serialize;
use tauscope_bus::{Keep, SampleKind};
use tauscope_pipeline::pipeline::{Pipeline, Placement, Stage};

pub use picture::{dot, mermaid};
pub use table::{keep_word, table};

/// Transport of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Over {
    /// Both ends are in one process; samples are passed by reference.
    InProcess,
    /// Both ends are on one host: iceoryx2.
    SharedMemory,
    /// The ends are on two hosts.
    Zenoh,
}

impl Over {
    /// Returns the transport in words.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::InProcess => "the process itself",
            Self::SharedMemory => "shared memory",
            Self::Zenoh => "Zenoh",
        }
    }
}

/// A link from one stage to another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Link {
    /// Sending stage, as an index into [`Pipeline::stages`].
    pub from: usize,
    /// Receiving stage, as an index into [`Pipeline::stages`].
    pub to: usize,
    /// Name of the stream: `<cell>/<stage>`.
    pub stream: String,
    /// Type of its samples.
    pub carries: SampleKind,
    /// Transport.
    pub over: Over,
    /// Overflow policy of the receiver.
    pub keep: Keep,
}

/// Returns all links of a pipeline, in the order of the receiving stages.
pub fn links(pipeline: &Pipeline) -> Vec<Link> {
    let mut links = Vec::new();
    for (to, stage) in pipeline.stages.iter().enumerate() {
        for &from in &stage.inputs {
            let maker = &pipeline.stages[from];
            let Some(carries) = maker.role.gives else {
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

/// Returns the transport between two stages. Within a process, the sender calls the receiver directly, unless the
/// receiver may skip samples or may wait for a disk or a network.
fn over(maker: &Stage, listener: &Stage) -> Over {
    let placement = |stage: &Stage| stage.role.kind.placement;
    let is_called = placement(listener) == Placement::WithCell
        && listener.keep == Keep::All
        && placement(maker) != Placement::Program;
    match (
        maker.host == listener.host,
        maker.process == listener.process,
    ) {
        (false, _) => Over::Zenoh,
        (true, true) if is_called => Over::InProcess,
        (true, _) => Over::SharedMemory,
    }
}

/// Returns for each stage the root of its group: the source, or the stage that receives a link, from which samples
/// reach it without leaving the process.
pub fn roots(pipeline: &Pipeline, links: &[Link]) -> Vec<usize> {
    let mut roots: Vec<usize> = (0..pipeline.stages.len()).collect();
    // Stages are in topological order: each comes after its inputs.
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
