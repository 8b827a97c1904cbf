//! A recording as the source of a pipeline.

use std::path::Path;

use tauscope_bus::{JointState, Source};
use tauscope_ingest::{
    Ahead, Config, CsvConfig, FileConfig, Findings, IngestError, RecordedSource, Topics,
};

use crate::build;
use crate::cell::Cell;

/// Opens a recording without pacing, with a handle to its findings. The columns of a table come from the pipeline,
/// else from its header or from a file next to it.
pub fn open(
    config: &Config,
    recording: &Path,
    cell: &Cell,
    ahead: bool,
) -> Result<(Box<dyn Source<JointState>>, Findings), IngestError> {
    let setup = build::ingest_setup(cell);
    let ending = recording.extension();
    let is_table = ending.is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
    let path = recording.to_owned();
    let mut source = match &config.csv {
        Some(csv) if is_table => {
            let csv = CsvConfig {
                path,
                ..csv.clone()
            };
            RecordedSource::open_csv(&csv, config, &setup)?
        }
        None if is_table => {
            let topics = Topics::default();
            RecordedSource::open_file(&FileConfig { path, topics }, config, &setup)?
        }
        _ => RecordedSource::open_file(&file_config(config, recording), config, &setup)?,
    };
    let findings = source.findings();
    if !ahead {
        return Ok((Box::new(source), findings));
    }
    let ahead = Ahead::new(source).map_err(IngestError::Thread)?;
    Ok((Box::new(ahead), findings))
}

/// File settings of a recording with the pipeline's topics.
pub fn file_config(config: &Config, recording: &Path) -> FileConfig {
    let topics = config.source().ok().and_then(|(_, source)| source.topics());
    // The archive of a simulated cell also contains the requests to learn.
    let simulated = || Topics {
        learn: Some("/learn".to_owned()),
        ..Topics::default()
    };
    FileConfig {
        path: recording.to_owned(),
        topics: topics.cloned().unwrap_or_else(simulated),
    }
}
