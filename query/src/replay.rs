//! Replay of the recordings of a query: the rows that `tauscope replay --manifest` writes.

use std::fs::File;
use std::path::{Path, PathBuf};

use arrow::array::RecordBatch;
use datafusion::error::Result;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use tauscope_pipeline::pipeline::Pipeline;
use tauscope_pipeline::replay::{Replay, TwinChoice};
use tauscope_pipeline::results::{Folder, Identity, Unit, Wanted, parquet_files};

use crate::scan::{Counts, Kind, Listed, Scan, external, open};

/// A pipeline with the identity of everything that its results depend on.
pub(crate) struct Loaded {
    pipeline: Pipeline,
    pub(crate) identity: Identity,
}

impl Loaded {
    pub(crate) fn load(path: &Path) -> Result<Self> {
        let pipeline = Pipeline::load_to_replay(path).map_err(external)?;
        let identity = Identity::of(&pipeline, TwinChoice::Recompute, false).map_err(external)?;
        Ok(Self { pipeline, identity })
    }

    pub(crate) fn replay(&self, source: Option<&str>) -> Result<Replay<'_>> {
        Replay::new(&self.pipeline, source, TwinChoice::Recompute).map_err(external)
    }
}

/// Replays recordings one after the other and passes their rows on. `gone` reports that the consumer needs no more
/// rows.
pub(crate) fn read(
    listed: &[Listed],
    scan: &Scan,
    counts: &Counts,
    gone: &dyn Fn() -> bool,
    give: &mut dyn FnMut(RecordBatch) -> bool,
) -> Result<()> {
    let Kind::Replay {
        pipeline: path,
        source,
        identity,
    } = &scan.kind
    else {
        return Ok(());
    };
    let loaded = Loaded::load(path)?;
    if loaded.identity.hash() != *identity {
        let path = path.display();
        return Err(external(format!(
            "{path}: this machine has another pipeline, URDF, twin or weights, or another version of tauscope, than the \
             query was planned with: copy them from there"
        )));
    }
    let replay = loaded.replay(source.as_deref())?;
    let folder = tempfile::Builder::new()
        .prefix("tauscope-query-")
        .tempdir()?;
    for (number, one) in listed.iter().enumerate() {
        open(one, counts)?;
        let failed = |error: String| external(format!("{}: {error}", one.path.display()));
        let wanted = Wanted::of(&one.path, source.as_deref()).map_err(failed)?;
        // One folder per recording, so that its contents belong to this recording only.
        let out = folder.path().join(number.to_string());
        let unit = Unit {
            replay: &replay,
            identity: &loaded.identity,
            shelf: &Folder::open(&out)?,
            with_scores: false,
        };
        match unit.run(&wanted, &mut |_| !gone()) {
            Ok(_) => {}
            Err(_) if gone() => return Ok(()),
            Err(error) => return Err(failed(error.to_string())),
        }
        for file in parquet_files(&out).map_err(external)? {
            if !give_file(&file, scan, give)? {
                return Ok(());
            }
        }
        std::fs::remove_dir_all(&out)?;
    }
    Ok(())
}

/// Passes the rows of a file on; returns whether more rows are needed.
fn give_file(
    path: &PathBuf,
    scan: &Scan,
    give: &mut dyn FnMut(RecordBatch) -> bool,
) -> Result<bool> {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(path)?)?;
    let mask = match &scan.projection {
        Some(columns) => ProjectionMask::roots(builder.parquet_schema(), columns.iter().copied()),
        None => ProjectionMask::all(),
    };
    // The query may need the columns in another order than the file.
    let order = scan.projection.as_ref().map(|columns| {
        let mut sorted = columns.clone();
        sorted.sort_unstable();
        let place = |column| {
            sorted
                .iter()
                .position(|other| other == column)
                .unwrap_or_default()
        };
        columns.iter().map(place).collect::<Vec<_>>()
    });
    for batch in builder.with_projection(mask).build()? {
        let batch = batch?;
        let batch = match &order {
            Some(order) => batch.project(order)?,
            None => batch,
        };
        if !give(batch) {
            return Ok(false);
        }
    }
    Ok(true)
}
