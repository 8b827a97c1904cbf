//! The table of stages. A new kind of stage needs its crate, its file in this folder, and one line here: the keys of
//! the pipeline file, their schema, `run`, `replay` and the conformance tests of all stages use this table.

pub mod detect;
pub mod ingest;
pub mod outside;
pub mod publish;
pub mod record;
pub mod twin;
pub mod watch;

use super::stage::Kind;

/// Poll interval of recorders and publishers for new samples \[ms\].
/// Resolution: latency of the live picture, against wake-ups of the machine.
const POLL_MS: u64 = 10;

/// All kinds of stages.
pub static STAGES: &[Kind] = &[
    Kind::of::<tauscope_ingest::Config>(),
    Kind::of::<tauscope_twin::Config>(),
    Kind::of::<tauscope_detect::Config>(),
    Kind::of::<tauscope_watch::Config>(),
    Kind::of::<tauscope_record::Config>(),
    Kind::of::<tauscope_publish::Config>(),
    Kind::of::<outside::OutsideEntry>(),
];
