//! Compiled part of the Python module `tauscope`: tables as Arrow, recordings read into them, and one command in a
//! separate process. The public part is `python/tauscope/*.py`.

mod joint_states;
mod table;

use std::ffi::OsString;
use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use joint_states::ReadError;
use table::Table;

/// Reads the joint states of a recording; returns the table, the topic, and one sentence per loss.
///
/// Raises `ValueError(message, file, line)` if nothing can be read.
#[pyfunction]
#[expect(
    clippy::needless_pass_by_value,
    reason = "pyo3 converts into owned paths"
)]
fn read_joint_states(
    py: Python<'_>,
    path: PathBuf,
    topic: Option<String>,
) -> PyResult<(Table, String, Vec<String>)> {
    // Ctrl-C sets a flag in the interpreter, which must be polled.
    #[expect(
        clippy::redundant_closure_for_method_calls,
        reason = "the method is not general enough over lifetimes"
    )]
    let may_go_on = || Python::attach(|py| py.check_signals());
    match py.detach(|| joint_states::read(&path, topic.as_deref(), &may_go_on)) {
        Ok(read) => Ok((Table::of(read.batch), read.topic, read.lost)),
        Err(ReadError::Stopped(error)) => Err(error),
        Err(error) => Err(PyValueError::new_err((
            error.to_string(),
            path,
            error.line(),
        ))),
    }
}

/// Reads a Parquet file that a command wrote.
#[pyfunction]
#[expect(
    clippy::needless_pass_by_value,
    reason = "pyo3 converts into owned paths"
)]
fn read_parquet(py: Python<'_>, path: PathBuf) -> PyResult<Table> {
    py.detach(|| table::read_parquet(&path))
        .map_err(|error| PyValueError::new_err(format!("{}: {error}", path.display())))
}

/// Runs a command, for which the process was started. Returns the exit code, the standard output, the messages for
/// people, and errors in files as JSON.
#[pyfunction]
fn command(py: Python<'_>, arguments: Vec<OsString>) -> PyResult<(u8, String, String, String)> {
    let answer = py.detach(|| tauscope::answer_alone(arguments))?;
    let errors = answer.errors.to_string();
    Ok((answer.code, answer.stdout, answer.stderr, errors))
}

/// The module.
#[pymodule]
fn _tauscope(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<Table>()?;
    module.add_function(wrap_pyfunction!(read_joint_states, module)?)?;
    module.add_function(wrap_pyfunction!(read_parquet, module)?)?;
    module.add_function(wrap_pyfunction!(command, module)?)
}
