//! Output of the answer, as a table for people or as a file.

use std::fs::File;
use std::io::{IsTerminal as _, Write};
use std::path::PathBuf;

use anyhow::Context as _;
use arrow::ipc::writer::{FileWriter, StreamWriter};
use arrow::json::LineDelimitedWriter;
use arrow::record_batch::RecordBatch;
use arrow::util::pretty::pretty_format_batches;
use datafusion::dataframe::DataFrame;
use futures::StreamExt as _;
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::WriterProperties;
use tauscope_archive::whole_file::{self, Existing};
use tauscope_pipeline::report::{Problem, Report};

/// Format of the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Format {
    /// A table for people.
    #[default]
    Table,
    /// A line of JSON for each row.
    Json,
    /// Parquet.
    Parquet,
    /// Arrow IPC: a file with --out, else a stream.
    Arrow,
}

/// Destination and format of the answer.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Answer {
    /// Format of the answer.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    /// The file of the answer; without it, standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite an existing file of the answer.
    #[arg(long)]
    force: bool,
}

impl Answer {
    /// Checks that an answer of this format can be written to this destination.
    ///
    /// # Errors
    /// If a binary format would go to the terminal, or the file exists already.
    pub fn check(&self) -> Result<(), Report> {
        match &self.out {
            None if matches!(self.format, Format::Parquet | Format::Arrow)
                && std::io::stdout().is_terminal() =>
            {
                Err(Problem::new("this format is not for a terminal")
                    .help("name a file with --out")
                    .into())
            }
            Some(path) if path.exists() && !self.force => {
                Err(Problem::of_file(path, "the file is there already")
                    .help("--force replaces it")
                    .into())
            }
            _ => Ok(()),
        }
    }

    /// Writes the rows as they arrive, or, as a table for people, all at once. A file gets its final name when it is
    /// complete.
    ///
    /// # Errors
    /// If the query fails or the file cannot be written.
    pub async fn write(&self, frame: DataFrame) -> anyhow::Result<()> {
        let Some(path) = &self.out else {
            return match self.to(frame, std::io::stdout()).await {
                // A reader that closes the pipe early, like `head`, is not an error.
                Err(error) if is_broken_pipe(&error) => Ok(()),
                written => written,
            };
        };
        let part = whole_file::part_of(path);
        let file = File::create(&part).with_context(|| part.display().to_string())?;
        if let Err(error) = self.to(frame, file).await {
            // The error of the query is reported, not that of removing the file.
            let _ = std::fs::remove_file(&part);
            return Err(error);
        }
        let existing = if self.force {
            Existing::Replace
        } else {
            Existing::Keep
        };
        whole_file::put_in_place(&part, path, existing).with_context(|| path.display().to_string())
    }

    async fn to(&self, frame: DataFrame, mut out: impl Write + Send) -> anyhow::Result<()> {
        if self.format == Format::Table {
            let batches = frame.collect().await?;
            writeln!(out, "{}", pretty_format_batches(&batches)?)?;
            return Ok(());
        }
        let mut stream = frame.execute_stream().await?;
        let mut rows = Rows::new(self, &stream.schema(), out)?;
        while let Some(batch) = stream.next().await {
            rows.write(&batch?)?;
        }
        rows.finish()
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let is = |cause: &(dyn std::error::Error + 'static)| {
        let io = cause.downcast_ref::<std::io::Error>();
        io.is_some_and(|io| io.kind() == std::io::ErrorKind::BrokenPipe)
    };
    // Arrow keeps only the text of some errors.
    error.chain().any(is) || error.to_string().contains("Broken pipe")
}

/// Writer of the rows, batch by batch.
enum Rows<W: Write + Send> {
    Json(LineDelimitedWriter<W>),
    Parquet(ArrowWriter<W>),
    ArrowFile(FileWriter<W>),
    ArrowStream(StreamWriter<W>),
}

impl<W: Write + Send> Rows<W> {
    fn new(answer: &Answer, schema: &arrow::datatypes::SchemaRef, out: W) -> anyhow::Result<Self> {
        Ok(match answer.format {
            Format::Table | Format::Json => Self::Json(LineDelimitedWriter::new(out)),
            Format::Parquet => {
                let properties = WriterProperties::builder()
                    .set_compression(Compression::ZSTD(ZstdLevel::default()));
                Self::Parquet(ArrowWriter::try_new(
                    out,
                    schema.clone(),
                    Some(properties.build()),
                )?)
            }
            Format::Arrow if answer.out.is_some() => {
                Self::ArrowFile(FileWriter::try_new(out, schema)?)
            }
            Format::Arrow => Self::ArrowStream(StreamWriter::try_new(out, schema)?),
        })
    }

    fn write(&mut self, batch: &RecordBatch) -> anyhow::Result<()> {
        match self {
            Self::Json(rows) => rows.write(batch)?,
            Self::Parquet(rows) => rows.write(batch)?,
            Self::ArrowFile(rows) => rows.write(batch)?,
            Self::ArrowStream(rows) => rows.write(batch)?,
        }
        Ok(())
    }

    fn finish(self) -> anyhow::Result<()> {
        match self {
            Self::Json(mut rows) => rows.finish()?,
            Self::Parquet(rows) => {
                rows.close()?;
            }
            Self::ArrowFile(mut rows) => rows.finish()?,
            Self::ArrowStream(mut rows) => rows.finish()?,
        }
        Ok(())
    }
}
