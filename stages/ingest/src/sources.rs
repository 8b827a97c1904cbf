//! Table of the sources. A new source needs its file, its key in [`Config`] and one line here: all code that opens
//! sources, finds their files or counts them uses this table.

use std::path::PathBuf;

use tauscope_bus::{JointState, Source};
use tauscope_dynamics::Model;

use crate::config::{
    Config, ConfigError, CsvConfig, FileConfig, SimulateConfig, Topics, UrRtdeConfig, ZenohConfig,
};
use crate::error::IngestError;
use crate::pacing::Paced;
use crate::recorded::RecordedSource;
use crate::setup::Setup;
use crate::simulated::{Scenario, ScenarioError, SimulatedCell};
use crate::ur_rtde::UrRtdeSource;
use crate::zenoh::ZenohSource;

/// Makes the entry of a source from its key, which is the name of its field in [`Config`].
macro_rules! entry {
    ($name:ident) => {
        Entry {
            name: stringify!($name),
            given: |config| config.$name.as_ref().map(|it| it as &dyn SourceSettings),
            given_mut: |config| {
                config
                    .$name
                    .as_mut()
                    .map(|it| it as &mut dyn SourceSettings)
            },
        }
    };
}
/// All sources, by their keys in a pipeline file.
pub static SOURCES: &[Entry] = &[
    entry!(file),
    entry!(csv),
    entry!(zenoh),
    entry!(ur_rtde),
    entry!(simulate),
];

/// Entry of a source in the table.
#[derive(Debug)]
pub struct Entry {
    /// Its key in a pipeline file.
    pub name: &'static str,
    /// Returns its settings, if given.
    pub given: fn(&Config) -> Option<&dyn SourceSettings>,
    /// Returns its settings for modification, if given.
    pub given_mut: fn(&mut Config) -> Option<&mut dyn SourceSettings>,
}

/// Settings of a source, and its properties that are known before it runs.
pub trait SourceSettings {
    /// Opens the source.
    ///
    /// # Errors
    /// If it cannot be opened; [`IngestError::is_input`] distinguishes faults of the input from others.
    fn open(&self, cell: &Opening<'_>) -> Result<Box<dyn Source<JointState>>, IngestError>;

    /// Returns the setting that names the file it reads, and the kind of file; `None` for a live source.
    fn file(&self) -> Option<(&'static str, &'static str)> {
        None
    }

    /// Returns the path of that file.
    fn path_mut(&mut self) -> Option<&mut PathBuf> {
        None
    }

    /// Returns the topics that it reads, if any.
    fn topics(&self) -> Option<&Topics> {
        None
    }

    /// Returns the remedy if an external twin's effort is required and the source gives none; `None` if it gives one,
    /// or has topics.
    fn without_twin(&self) -> Option<&'static str> {
        None
    }

    /// Returns the setting that makes its efforts motor currents in A, if there is one.
    fn gives_amperes(&self) -> Option<&'static str> {
        None
    }

    /// Returns the reason why it can never give a sample, and the remedy.
    fn fault(&self) -> Option<(&'static str, &'static str)> {
        None
    }
}

/// Arguments for opening a source.
#[derive(Debug, Clone, Copy)]
pub struct Opening<'a> {
    /// Settings shared by all sources.
    pub config: &'a Config,
    /// The cell.
    pub setup: &'a Setup,
    /// The simulated robot, for `simulate` only.
    pub robot: Option<&'a SimulatedRobot>,
}

/// Scenario and robot of a simulated cell; the program loads both files.
#[derive(Debug, Clone)]
pub struct SimulatedRobot {
    /// The scenario, its paths resolved.
    pub scenario: Scenario,
    /// The robot that the scenario names.
    pub model: Model,
}

impl SourceSettings for FileConfig {
    fn open(&self, cell: &Opening<'_>) -> Result<Box<dyn Source<JointState>>, IngestError> {
        let source = RecordedSource::open_file(self, cell.config, cell.setup)?;
        Ok(Box::new(source))
    }

    fn file(&self) -> Option<(&'static str, &'static str)> {
        Some(("path", "recording"))
    }

    fn path_mut(&mut self) -> Option<&mut PathBuf> {
        Some(&mut self.path)
    }

    fn topics(&self) -> Option<&Topics> {
        Some(&self.topics)
    }
}

impl SourceSettings for CsvConfig {
    fn open(&self, cell: &Opening<'_>) -> Result<Box<dyn Source<JointState>>, IngestError> {
        let source = RecordedSource::open_csv(self, cell.config, cell.setup)?;
        Ok(Box::new(source))
    }

    fn file(&self) -> Option<(&'static str, &'static str)> {
        Some(("path", "table"))
    }

    fn path_mut(&mut self) -> Option<&mut PathBuf> {
        Some(&mut self.path)
    }
}

impl SourceSettings for SimulateConfig {
    fn open(&self, cell: &Opening<'_>) -> Result<Box<dyn Source<JointState>>, IngestError> {
        let robot = cell.robot.ok_or(ScenarioError::NotLoaded)?;
        let name = self.recording.as_deref();
        let (scenario, model) = (&robot.scenario, &robot.model);
        let source = SimulatedCell::new(scenario, model, name, cell.config, cell.setup)?;
        Ok(Box::new(source))
    }

    fn file(&self) -> Option<(&'static str, &'static str)> {
        Some(("scenario", "scenario"))
    }

    fn path_mut(&mut self) -> Option<&mut PathBuf> {
        Some(&mut self.scenario)
    }
}

impl SourceSettings for ZenohConfig {
    fn open(&self, cell: &Opening<'_>) -> Result<Box<dyn Source<JointState>>, IngestError> {
        Ok(Box::new(ZenohSource::open(self, cell.config, cell.setup)?))
    }

    fn topics(&self) -> Option<&Topics> {
        Some(&self.topics)
    }

    fn fault(&self) -> Option<(&'static str, &'static str)> {
        let alone = self.connect.is_empty() && self.listen.is_empty();
        alone.then_some((
            "nothing can reach this source: it neither connects nor listens",
            "give `connect: [\"tcp/localhost:7447\"]`",
        ))
    }
}

impl SourceSettings for UrRtdeConfig {
    fn open(&self, cell: &Opening<'_>) -> Result<Box<dyn Source<JointState>>, IngestError> {
        Ok(Box::new(UrRtdeSource::open(self, cell.config, cell.setup)?))
    }

    fn fault(&self) -> Option<(&'static str, &'static str)> {
        self.host.trim().is_empty().then_some((
            "the controller has no address",
            "give `host: 192.168.0.10`, or the controller's name",
        ))
    }

    fn gives_amperes(&self) -> Option<&'static str> {
        (self.effort == crate::config::UrEffort::ActualCurrent).then_some("effort: actual_current")
    }

    fn without_twin(&self) -> Option<&'static str> {
        (!self.target_moment).then_some("set `target_moment: true` there")
    }
}

impl Config {
    /// Returns the key and the settings of the one configured source.
    ///
    /// # Errors
    /// If there is none, or more than one.
    pub fn source(&self) -> Result<(&'static str, &dyn SourceSettings), ConfigError> {
        let given = |entry: &Entry| Some((entry.name, (entry.given)(self)?));
        let mut all = SOURCES.iter().filter_map(given);
        let first = all.next();
        match (first, all.count()) {
            (Some(source), 0) => Ok(source),
            (first, others) => Err(ConfigError::OneSource {
                found: others + usize::from(first.is_some()),
            }),
        }
    }

    /// Returns the path in the settings, so that the program can resolve it against the pipeline file.
    pub fn path_mut(&mut self) -> Option<&mut PathBuf> {
        let given = SOURCES.iter().find(|entry| (entry.given)(self).is_some())?;
        (given.given_mut)(self)?.path_mut()
    }
}

/// Opens the source that `config` names, paced at its rate unless it is live. Only `simulate` needs
/// `robot`.
///
/// # Errors
/// If the source cannot be opened; [`IngestError::is_input`] distinguishes faults of the input from others.
pub fn open(
    config: &Config,
    setup: &Setup,
    robot: Option<&SimulatedRobot>,
) -> Result<Box<dyn Source<JointState>>, IngestError> {
    let (_, settings) = config.source()?;
    let source = settings.open(&Opening {
        config,
        setup,
        robot,
    })?;
    let is_live = settings.file().is_none();
    Ok(match config.rate.factor().filter(|_| !is_live) {
        Some(factor) => Box::new(Paced::new(source, factor)),
        None => source,
    })
}
