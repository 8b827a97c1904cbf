//! A source: checked, opened live, and replaced by a recording.

mod after;
mod recorded;

use serde::{Deserialize, Serialize};
use tauscope_archive::is_there;
use tauscope_bus::shell::Node;
use tauscope_bus::{JointState, LinkError, SampleKind, Source};
use tauscope_dynamics::{Link, Model};
use tauscope_ingest::{Commanded, Config, IngestError, Paced, Rate, SourceSettings};

use crate::announce;
use crate::build::ingest_setup;
use crate::cell::{Cell, EffortUnit};
use crate::pipeline::stage::check::{Check, Slow, Spot};
use crate::pipeline::stage::role::Takes;
use crate::pipeline::stage::site::{LiveSite, NodeError, ReplaySite};
use crate::pipeline::stage::{StageConfig, StageSettings};
use crate::plausible::{self, Watched};
use crate::scenario::ScenarioFacts;
use crate::yaml::Place;

use after::After;
pub use recorded::file_config;

/// Settings of a source.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct IngestSettings {
    /// Settings from the pipeline file.
    pub config: Box<Config>,
    /// Scenario of a simulated source.
    pub scenario: Option<ScenarioFacts>,
}

impl IngestSettings {
    /// Whether the source reads a file, and can therefore wait without loss.
    pub fn reads_file(&self) -> bool {
        (self.config.source()).is_ok_and(|(_, source)| source.file().is_some())
    }

    /// Opens the source of `cell`. A restarted source that reads a file continues after the sample with the stamp
    /// `after_ns`.
    fn open(
        &self,
        cell: &Cell,
        after_ns: Option<i64>,
    ) -> Result<Box<dyn Source<JointState>>, NodeError> {
        let (config, setup) = (&*self.config, ingest_setup(cell));
        let robot = self.scenario.as_ref().map(ScenarioFacts::robot);
        let robot = robot.transpose()?;
        // A live source cannot repeat past samples.
        let (_, source) = config.source().map_err(IngestError::from)?;
        let Some(after_ns) = after_ns.filter(|_| source.file().is_some()) else {
            return Ok(tauscope_ingest::open(config, &setup, robot.as_ref())?);
        };
        // Samples emitted before the restart are skipped at full speed; pacing starts after them.
        let fast = Config {
            rate: Rate::Fast,
            ..config.clone()
        };
        let rest = After {
            inner: tauscope_ingest::open(&fast, &setup, robot.as_ref())?,
            after_ns,
        };
        Ok(match config.rate.factor() {
            Some(factor) => Box::new(Paced::new(rest, factor)),
            None => Box::new(rest),
        })
    }

    /// Sample rate \[Hz\], if known before the source is read.
    pub fn rate_hz(&self) -> Option<f64> {
        if let Some(scenario) = &self.scenario {
            return Some(scenario.scenario.rate_hz);
        }
        if let Some(controller) = &self.config.ur_rtde {
            return Some(controller.rate_hz);
        }
        let file = self.config.file.as_ref()?;
        let recording = tauscope_session::open(&file.path).ok()?;
        plausible::recorded_rate_hz(&recording, &file.topics.state).ok()?
    }
}

impl StageConfig for Config {
    type Settings = IngestSettings;

    const KEY: &'static str = "ingest";
    const ABOUT: &'static str = "A source of joint states.";

    fn takes(&self) -> Takes {
        Takes::Nothing
    }

    fn gives(&self) -> Option<SampleKind> {
        Some(SampleKind::JointState)
    }

    fn check(&self, check: &mut Check<'_>, spot: &Spot) -> Option<IngestSettings> {
        let (index, place) = (spot.index, &spot.place);
        let (key, source) = match self.source() {
            Ok(source) => source,
            Err(error) => {
                check.push(check.file.at_key(place, error.to_string()));
                return None;
            }
        };
        if let Some((title, help)) = source.fault() {
            let problem = check.file.at_key(&place.key(key), title);
            check.push(problem.help(help));
        }
        check_unit(check, index, &place.key(key), source);
        let file = source.file();
        let path_place = file.map_or(place.clone(), |(path, _)| place.key(key).key(path));
        let mut config = self.clone();
        if let Some(path) = config.path_mut() {
            *path = check.file.resolve(path);
        }
        let missing = config.path_mut().filter(|path| !is_there(path)).cloned();
        if let (Some(path), Some((_, what))) = (missing, file)
            && check.is_here(index)
        {
            let title = format!("there is no {what} {}", path.display());
            check.push(check.file.at(&path_place, title));
            return None;
        }
        let scenario = match &config.simulate {
            Some(simulate) if check.is_here(index) => {
                match ScenarioFacts::load(&simulate.scenario) {
                    Ok(scenario) => Some(scenario),
                    Err(problems) => {
                        check.report.append(problems);
                        return None;
                    }
                }
            }
            _ => None,
        };
        let settings = IngestSettings {
            config: Box::new(config),
            scenario,
        };
        let opens = opens(check, index, path_place, &settings);
        check.slow.extend(opens);
        Some(settings)
    }
}

/// Checks that the source's unit of effort is that of its cell.
fn check_unit(check: &mut Check<'_>, index: usize, place: &Place, source: &dyn SourceSettings) {
    if let (Some(setting), Some(cell)) = (source.gives_amperes(), check.cell(index))
        && cell.facts.effort_unit == EffortUnit::Nm
    {
        let title = format!(
            "the source gives motor currents (`{setting}`), but the cell's effort is in N m"
        );
        let problem = check.file.at_key(place, title);
        let name = &cell.facts.name;
        check.push(problem.help(format!("give the cell `{name}` `effort_unit: A`")));
    }
}

/// Returns the check that opens a source as the stage will, so that errors in its files are reported before the start.
/// `None` for a source without files.
fn opens<'a>(
    check: &Check<'a>,
    index: usize,
    place: Place,
    settings: &IngestSettings,
) -> Option<Slow<'a>> {
    let (file, cell) = (check.file, check.cell(index)?);
    let is_live = |(_, source): (_, &dyn SourceSettings)| source.file().is_none();
    if settings.config.source().is_ok_and(is_live) || !check.is_here(index) {
        return None;
    }
    let settings = settings.clone();
    Some(Box::new(move || {
        let opened = settings.open(cell, None);
        opened.err().map(|error| file.at(&place, error.to_string()))
    }))
}

impl StageSettings for IngestSettings {
    fn live(&self, site: &LiveSite<'_>) -> Result<Node<'static>, NodeError> {
        let cell = site.cell()?;
        let source = self.open(cell, site.after_ns)?;
        let source = commanded(source, &self.config, cell, site.somebody_learns)
            .map_err(NodeError::Commands)?;
        let source = Watched::new(site.stage, source, plausible::of_cell(cell));
        let source = announce::commands::Announced::new(site.stage, source);
        Ok(Node::source(Box::new(source)))
    }

    fn replayed<'n>(&self, site: &mut ReplaySite<'_>) -> Result<Option<Node<'n>>, NodeError> {
        let (source, findings) =
            recorded::open(&self.config, site.recording, site.cell, site.reads_ahead)?;
        *site.findings = findings;
        Ok(Some(Node::source(Box::new(Commanded::archived(source)))))
    }
}

/// Adds commands to a source of `cell`: live ones from the endpoints of its configuration, otherwise those of the
/// archive. Requests to learn are accepted if `somebody_learns`.
///
/// # Errors
/// If the command endpoints cannot be opened.
fn commanded(
    source: Box<dyn Source<JointState>>,
    config: &Config,
    cell: &Cell,
    somebody_learns: bool,
) -> Result<Commanded, LinkError> {
    match &config.commands {
        Some(endpoints) => {
            let links = cell.model.as_ref().map(Model::links);
            let arm_kg = links.map(|links| links.iter().map(Link::mass_kg).sum::<f64>());
            let takes = tauscope_ingest::Takes {
                learn: somebody_learns,
                arm_kg: arm_kg.filter(|kg| *kg > 0.0),
            };
            Commanded::live(source, &ingest_setup(cell), endpoints, takes)
        }
        None => Ok(Commanded::archived(source)),
    }
}
