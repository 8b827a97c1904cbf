//! Fuzz targets for all code that reads foreign bytes: any input must give no panic, no abort, no hang and bounded
//! memory. `README.md` lists the runs and their findings.

mod bus;
mod files;
mod messages;

/// Processes an input. It may return any error.
pub type Take = fn(&[u8]);

/// One place at which tauscope reads foreign bytes.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// Name, also of the folder of its corpus.
    pub name: &'static str,
    /// Function under test.
    pub take: Take,
}

macro_rules! targets {
    ($($name:ident: $take:path),+ $(,)?) => {
        [$(Target { name: stringify!($name), take: $take }),+]
    };
}

/// All targets.
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
