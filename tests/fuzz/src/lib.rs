//! Everything that reads what others wrote, as targets for a fuzzer: whatever the bytes, no panic, no abort, no hang
//! and no more memory than is bounded. `README.md` says what was run, and what it found.

mod bus;
mod files;
mod messages;

/// Takes an input. It may refuse it in any way that an error is.
pub type Take = fn(&[u8]);

/// One place at which tauscope reads what others wrote.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// Also the folder of its corpus.
    pub name: &'static str,
    /// What reads.
    pub take: Take,
}

macro_rules! targets {
    ($($name:ident: $take:path),+ $(,)?) => {
        [$(Target { name: stringify!($name), take: $take }),+]
    };
}

/// All of them.
pub const TARGETS: [Target; 12] = targets! {
    bus_samples: bus::samples,
    cdr: messages::cdr,
    command: messages::command,
    csv: files::csv,
    lerobot: files::lerobot,
    mcap: files::mcap,
    modbus: messages::modbus,
    pipeline: files::pipeline,
    ros1_bag: files::ros1_bag,
    status: messages::status,
    twin: files::twin,
    urdf: files::urdf,
};
