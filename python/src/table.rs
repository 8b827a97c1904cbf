//! A table in Arrow's memory layout, exported through the Arrow `PyCapsule` interface without copying
//! (<https://arrow.apache.org/docs/format/CDataInterface/PyCapsuleInterface.html>).

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Array, RecordBatch, RecordBatchIterator, StringArray};
use arrow::datatypes::SchemaRef;
use arrow::error::ArrowError;
use arrow::ffi::FFI_ArrowSchema;
use arrow::ffi_stream::FFI_ArrowArrayStream;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;

/// Columns of equal length in Arrow's layout. `pyarrow.table`, `polars.from_arrow`, `duckdb` and every other library
/// with the Arrow `PyCapsule` interface read it without a copy.
#[pyclass(module = "tauscope", frozen)]
#[derive(Debug)]
pub struct Table {
    schema: SchemaRef,
    batches: Vec<RecordBatch>,
}

impl Table {
    /// Creates a table of one batch.
    pub fn of(batch: RecordBatch) -> Self {
        Self {
            schema: batch.schema(),
            batches: vec![batch],
        }
    }
}

#[pymethods]
impl Table {
    /// Creates a table of text.
    #[staticmethod]
    fn of_text(names: Vec<String>, columns: Vec<Vec<String>>) -> PyResult<Self> {
        let arrays = columns
            .into_iter()
            .map(|column| Arc::new(StringArray::from(column)) as ArrayRef);
        let batch = RecordBatch::try_from_iter(names.into_iter().zip(arrays)).map_err(refused)?;
        Ok(Self::of(batch))
    }

    /// Creates a table of names and, for each name, a number from every column; `None` is null.
    #[staticmethod]
    fn of_numbers(
        key: String,
        keys: Vec<String>,
        names: Vec<String>,
        columns: Vec<Vec<Option<f64>>>,
    ) -> PyResult<Self> {
        let first: ArrayRef = Arc::new(StringArray::from(keys));
        let arrays = columns
            .into_iter()
            .map(|column| Arc::new(Float64Array::from(column)) as ArrayRef);
        let columns = std::iter::once((key, first)).chain(names.into_iter().zip(arrays));
        Ok(Self::of(
            RecordBatch::try_from_iter(columns).map_err(refused)?,
        ))
    }

    /// Number of rows.
    #[getter]
    fn num_rows(&self) -> usize {
        self.batches.iter().map(RecordBatch::num_rows).sum()
    }

    /// Names of the columns, in their order.
    #[getter]
    fn column_names(&self) -> Vec<String> {
        let fields = self.schema.fields().iter();
        fields.map(|field| field.name().clone()).collect()
    }

    fn __len__(&self) -> usize {
        self.num_rows()
    }

    fn __repr__(&self) -> String {
        let fields = self.schema.fields().iter();
        let columns: Vec<String> = fields
            .map(|field| format!("{}: {}", field.name(), field.data_type()))
            .collect();
        format!(
            "<tauscope.Table of {} rows: {}>",
            self.num_rows(),
            columns.join(", ")
        )
    }

    /// The columns and their types, as an `ArrowSchema`.
    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        let schema = FFI_ArrowSchema::try_from(self.schema.as_ref()).map_err(refused)?;
        PyCapsule::new(py, schema, Some(c"arrow_schema".to_owned()))
    }

    /// The data, as an `ArrowArrayStream`. The schema is always the table's own; a requested schema is ignored.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // The interface allows a producer to ignore the requested schema; the consumer then casts.
        drop(requested_schema);
        // Clones share the buffers.
        let batches = self.batches.clone().into_iter().map(Ok);
        let reader = RecordBatchIterator::new(batches, SchemaRef::clone(&self.schema));
        let stream = FFI_ArrowArrayStream::new(Box::new(reader));
        PyCapsule::new(py, stream, Some(c"arrow_array_stream".to_owned()))
    }
}

#[allow(clippy::needless_pass_by_value, reason = "it is for map_err")]
fn refused(error: ArrowError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Reason why a Parquet file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ParquetFailure {
    /// The file cannot be opened.
    #[error("cannot open: {0}")]
    Open(#[from] std::io::Error),
    /// The file is not valid Parquet.
    #[error(transparent)]
    Parquet(#[from] parquet::errors::ParquetError),
    /// The columns do not form a table.
    #[error(transparent)]
    Arrow(#[from] ArrowError),
}

/// Reads a Parquet file.
///
/// # Errors
/// If it cannot be read.
pub fn read_parquet(path: &Path) -> Result<Table, ParquetFailure> {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(path)?)?;
    let schema = SchemaRef::clone(builder.schema());
    let batches = builder.build()?.collect::<Result<_, _>>()?;
    Ok(Table { schema, batches })
}
