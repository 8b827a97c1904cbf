//! The table of sources. Adding one is its file, its key in [`Config`] and one line here: who opens sources,
//! looks for their files or says how many are given goes through this table.

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

/// The entry of the source with this key, which is that of its field in [`Config`].
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

/// What the table says of a source.
#[derive(Debug)]
pub struct Entry {
    /// Its key in a pipeline file.
    pub name: &'static str,
    /// Its settings, where they are given.
    pub given: fn(&Config) -> Option<&dyn SourceSettings>,
    /// The same, to be changed.
    pub given_mut: fn(&mut Config) -> Option<&mut dyn SourceSettings>,
}

/// Settings of a source, and all that is known of it before it runs.
pub trait SourceSettings {
    /// Opens it.
    ///
    /// # Errors
    /// If it cannot be opened; [`IngestError::is_input`] tells whose fault that is.
    fn open(&self, cell: &Opening<'_>) -> Result<Box<dyn Source<JointState>>, IngestError>;

    /// The setting that names the file it reads, and what that file is; `None` for a live source.
    fn file(&self) -> Option<(&'static str, &'static str)> {
        None
    }

    /// The path of that file.
    fn path_mut(&mut self) -> Option<&mut PathBuf> {
        None
    }

    /// The topics that it reads, if it reads any.
    fn topics(&self) -> Option<&Topics> {
        None
    }

    /// What would help where another twin's effort is wanted and it gives none; `None` if it gives one, or has topics.
    fn without_twin(&self) -> Option<&'static str> {
        None
    }

    /// The setting by which its efforts are motor currents in A, where it is known.
    fn gives_amperes(&self) -> Option<&'static str> {
        None
    }

    /// Why it can never give a sample, and what would help.
    fn fault(&self) -> Option<(&'static str, &'static str)> {
        None
    }
}

/// What a source is opened with.
#[derive(Debug, Clone, Copy)]
pub struct Opening<'a> {
    /// What all sources share.
    pub config: &'a Config,
    /// The cell.
    pub setup: &'a Setup,
    /// The simulated robot, for who simulates one.
    pub robot: Option<&'a SimulatedRobot>,
}

/// What a simulated cell needs besides its configuration; the program loads both files.
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
    /// The one source that is configured, and its key.
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

    /// The path in it, so that the program can resolve it against the pipeline file.
    pub fn path_mut(&mut self) -> Option<&mut PathBuf> {
        let given = SOURCES.iter().find(|entry| (entry.given)(self).is_some())?;
        (given.given_mut)(self)?.path_mut()
    }
}

/// Opens the source that `config` names, paced as it says unless it is live. `robot` is needed by
/// `simulate` only.
///
/// # Errors
/// If the source cannot be opened; [`IngestError::is_input`] tells whose fault that is.
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
