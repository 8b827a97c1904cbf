//! From a pipeline to what runs where: streams, links and the transports they take.

mod picture;
mod table;

use serde::Serialize;
use tauscope_bus::{Keep, SampleKind};
use tauscope_pipeline::pipeline::Pipeline;

pub use picture::{dot, mermaid};
pub use table::{keep_word, table};

/// What a link runs over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Over {
    /// Both ends are on one host: iceoryx2.
    SharedMemory,
    /// The ends are on two hosts.
    Zenoh,
}

impl Over {
    /// In words.
    pub fn as_str(self) -> &'static str {
        match self {
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
            let over = if maker.host == stage.host {
                Over::SharedMemory
            } else {
                Over::Zenoh
            };
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
