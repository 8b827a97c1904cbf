//! A recording in the place of a pipeline's own source.

use std::path::Path;

use tauscope_bus::{JointState, Source};
use tauscope_ingest::{
    Ahead, Config, CsvConfig, FileConfig, Findings, IngestError, RecordedSource, Topics,
};

use crate::build;
use crate::cell::Cell;

/// Opens it, not paced, with a handle to the findings about it. Of a table the pipeline may give the columns; else its
/// header does, or a file next to it.
pub(super) fn recording(
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

/// The pipeline's topics, for a recording of its robot.
pub(super) fn file_config(config: &Config, recording: &Path) -> FileConfig {
    let topics = config.source().ok().and_then(|(_, source)| source.topics());
    // What a simulated cell was asked for is in its archive, too.
    let simulated = || Topics {
        learn: Some("/learn".to_owned()),
        ..Topics::default()
    };
    FileConfig {
        path: recording.to_owned(),
        topics: topics.cloned().unwrap_or_else(simulated),
    }
}
