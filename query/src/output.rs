//! The answer, as a table for people or as a file.

use std::fs::File;
use std::io::Write;
use std::path::Path;

use anyhow::Context as _;
use arrow::ipc::writer::FileWriter;
use arrow::json::LineDelimitedWriter;
use arrow::util::pretty::pretty_format_batches;
use datafusion::dataframe::DataFrame;
use futures::StreamExt as _;
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::WriterProperties;
use tauscope_archive::whole_file::{self, Existing};

/// How an answer is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Format {
    /// A table for people.
    #[default]
    Table,
    /// A line of JSON for each row.
    Json,
    /// Parquet.
    Parquet,
    /// An Arrow IPC file.
    Arrow,
}

/// Whether an answer of this format can go there.
///
/// # Errors
/// If it is not for a terminal and no file is named, or the file is there already.
pub fn check(format: Format, out: Option<&Path>) -> anyhow::Result<()> {
    match out {
        None if matches!(format, Format::Parquet | Format::Arrow) => {
            anyhow::bail!("name the file of the answer with --out")
        }
        Some(path) if path.exists() => anyhow::bail!("{} is there already", path.display()),
        _ => Ok(()),
    }
}

/// Writes the rows as they come; a table for people only once all are there.
///
/// # Errors
/// If the query fails or the file cannot be written.
pub async fn write(frame: DataFrame, format: Format, out: Option<&Path>) -> anyhow::Result<()> {
    let Some(path) = out else {
        return to(frame, format, std::io::stdout()).await;
    };
    let part = whole_file::part_of(path);
    let file = File::create(&part).with_context(|| part.display().to_string())?;
    let written = to(frame, format, file).await;
    if let Err(error) = written {
        let _ = std::fs::remove_file(&part);
        return Err(error);
    }
    whole_file::put_in_place(&part, path, Existing::Keep)
        .with_context(|| path.display().to_string())
}

async fn to(frame: DataFrame, format: Format, mut out: impl Write + Send) -> anyhow::Result<()> {
    let schema = frame.schema().as_arrow().clone().into();
    if format == Format::Table {
        let batches = frame.collect().await?;
        writeln!(out, "{}", pretty_format_batches(&batches)?)?;
        return Ok(());
    }
    let mut stream = frame.execute_stream().await?;
    match format {
        Format::Table | Format::Json => {
            let mut writer = LineDelimitedWriter::new(out);
            while let Some(batch) = stream.next().await {
                writer.write(&batch?)?;
            }
            writer.finish()?;
        }
        Format::Parquet => {
            let properties = WriterProperties::builder()
                .set_compression(Compression::ZSTD(ZstdLevel::default()))
                .build();
            let mut writer = ArrowWriter::try_new(out, schema, Some(properties))?;
            while let Some(batch) = stream.next().await {
                writer.write(&batch?)?;
            }
            writer.close()?;
        }
        Format::Arrow => {
            let mut writer = FileWriter::try_new(out, &schema)?;
            while let Some(batch) = stream.next().await {
                writer.write(&batch?)?;
            }
            writer.finish()?;
        }
    }
    Ok(())
}
