//! Context in which the entries of a pipeline file are checked.

use std::collections::BTreeMap;

use super::entry::StageEntry;
use super::{Settings, StageConfig, StageSettings};
use crate::cell::Cell;
use crate::pipeline::file::PipelineFile;
use crate::pipeline::wiring::Wiring;
use crate::report::{Problem, Report};
use crate::yaml::{Located, Place};

/// Purpose for which a pipeline is loaded.
#[derive(Debug, Clone, Copy)]
pub enum Purpose<'a> {
    /// Run on this host; on all hosts if `None`.
    Run {
        /// The host.
        host: Option<&'a str>,
    },
    /// Replay of recordings in place of its sources.
    Replay,
}

/// Place of a stage's part in the file.
#[derive(Debug, Clone)]
pub struct Spot {
    /// Index of the stage in the file.
    pub index: usize,
    /// Place of the key that defines its kind.
    pub place: Place,
}

/// The file, and what is known of it while its stages are checked.
pub struct Check<'a> {
    /// The file.
    pub file: &'a Located<PipelineFile>,
    /// Purpose of the pipeline.
    pub purpose: Purpose<'a>,
    /// The valid cells.
    pub cells: &'a BTreeMap<String, Cell>,
    /// The graph; `None` if it is invalid.
    pub wiring: Option<&'a Wiring>,
    /// Settings by stage, of the stages checked so far; `None` if they are invalid. A stage is checked after its
    /// inputs.
    pub settings: Vec<Option<Settings>>,
    /// The problems found.
    pub report: &'a mut Report,
    /// Checks that read files: they run last, on all cores.
    pub slow: Vec<Slow<'a>>,
}

/// A check that reads files; returns the problem, if there is one.
pub type Slow<'a> = Box<dyn FnOnce() -> Option<Problem> + Send + 'a>;

impl<'a> Check<'a> {
    /// Entry of a stage.
    pub fn entry(&self, index: usize) -> &'a StageEntry {
        &self.file.value.stages[index]
    }

    /// Settings of a checked stage, if they are valid and their type is `S`.
    pub fn settings<S: StageSettings>(&self, index: usize) -> Option<&S> {
        self.settings[index].as_ref()?.get()
    }

    /// Whether the stage may run on the host of the check. In a replay no stage has files of its own.
    pub fn is_here(&self, index: usize) -> bool {
        let Purpose::Run { host: here } = self.purpose else {
            return false;
        };
        let host = self.entry(index).host.as_deref();
        here.is_none() || host.is_none() || host == here
    }

    /// The stage's cell, if stage and cell are valid so far.
    pub fn cell(&self, index: usize) -> Option<&'a Cell> {
        self.cells.get(self.wiring?.cells[index].first()?)
    }

    /// The nearest stage upstream of this one of the kind `C`.
    pub fn above<C: StageConfig>(&self, index: usize) -> Option<usize> {
        let wiring = self.wiring?;
        let mut at = index;
        while let [input] = wiring.inputs[at].as_slice() {
            at = *input;
            if wiring.roles[at].kind.is::<C>() {
                return Some(at);
            }
        }
        None
    }

    /// Reports a problem.
    pub fn push(&mut self, problem: Problem) {
        self.report.push(problem);
    }
}
