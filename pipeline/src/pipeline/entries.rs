//! Resolution of the stages' settings: recordings, twins, programs, outputs.

mod detector;
mod model_fits;
mod outputs;
mod publish;
mod record;

use std::collections::BTreeMap;
use std::path::Path;

use tauscope_archive::is_there;
use tauscope_ingest::SourceSettings;
use tauscope_twin::{Expected, Motion, TwinFile};

use super::Purpose;
use super::file::{PipelineFile, StageEntry, stage_place};
use super::role::{FORMER_WATCH_KEY, Role};
use super::wiring::Wiring;
use crate::cell::{Cell, EffortUnit};
use crate::report::Report;
use crate::scenario::ScenarioFacts;
use crate::settings::{OutsideEntry, Settings};
use crate::yaml::{self, Located, Place};
use crate::{build, learnt_state, provenance};

/// Resolved settings and the content of the files that they name.
pub struct Files {
    /// Settings by stage; `None` if they are invalid.
    pub settings: Vec<Option<Settings>>,
    /// SHA-256 of each twin's model, by the stage's name.
    pub model_sha256: BTreeMap<String, String>,
    /// Scenarios of simulated sources, by stage.
    pub scenarios: BTreeMap<usize, ScenarioFacts>,
}

/// Reads and checks the settings of all stages, in the order of the file.
pub fn resolve(
    file: &Located<PipelineFile>,
    purpose: Purpose<'_>,
    cells: &BTreeMap<String, Cell>,
    wiring: Option<&Wiring>,
    report: &mut Report,
) -> Files {
    let mut resolver = Resolver {
        file,
        purpose,
        cells,
        wiring,
        report,
        models: BTreeMap::new(),
        model_sha256: BTreeMap::new(),
        scenarios: BTreeMap::new(),
    };
    let count = file.value.stages.len();
    // Twins before detectors, which need their models.
    for index in 0..count {
        resolver.twin_model(index);
    }
    let settings = (0..count).map(|index| resolver.stage(index)).collect();
    resolver.outputs_apart();
    Files {
        settings,
        model_sha256: resolver.model_sha256,
        scenarios: resolver.scenarios,
    }
}

struct Resolver<'a> {
    file: &'a Located<PipelineFile>,
    purpose: Purpose<'a>,
    cells: &'a BTreeMap<String, Cell>,
    wiring: Option<&'a Wiring>,
    report: &'a mut Report,
    /// Models by twin stage; absent if the twin names none or it is invalid.
    models: BTreeMap<usize, TwinFile>,
    model_sha256: BTreeMap<String, String>,
    scenarios: BTreeMap<usize, ScenarioFacts>,
}

impl<'a> Resolver<'a> {
    fn entry(&self, index: usize) -> &'a StageEntry {
        &self.file.value.stages[index]
    }

    /// Whether the stage may run on the host of the check. In a replay no stage has files of its own.
    fn is_here(&self, index: usize) -> bool {
        let Purpose::Run { host: here } = self.purpose else {
            return false;
        };
        let host = self.entry(index).host.as_deref();
        here.is_none() || host.is_none() || host == here
    }

    /// The stage's cell, if stage and cell are valid so far.
    fn cell(&self, index: usize) -> Option<&'a Cell> {
        self.cells.get(self.wiring?.cells[index].first()?)
    }

    /// The nearest stage upstream of this one whose role is `wanted`.
    fn above(&self, index: usize, wanted: fn(Role) -> bool) -> Option<usize> {
        let wiring = self.wiring?;
        let mut at = index;
        while let [input] = wiring.inputs[at].as_slice() {
            at = *input;
            if wanted(wiring.roles[at]) {
                return Some(at);
            }
        }
        None
    }

    fn stage(&mut self, index: usize) -> Option<Settings> {
        let entry = self.entry(index);
        let place = stage_place(index);
        if let Some(config) = &entry.ingest {
            return self.ingest(index, &place.key("ingest"), config);
        }
        if let Some(config) = &entry.twin {
            return self.twin(index, &place.key("twin"), config);
        }
        if let Some(config) = &entry.detect {
            return self.detect(index, &place.key("detect"), config);
        }
        if let Some(config) = &entry.watch {
            return self.watch(index, &place.key("watch"), config);
        }
        if let Some(config) = &entry.explain {
            return self.watch(index, &place.key(FORMER_WATCH_KEY), config);
        }
        if let Some(config) = &entry.record {
            return self.record(index, &place.key("record"), config);
        }
        if let Some(config) = &entry.publish {
            return self.publish(index, &place.key("publish"), config);
        }
        let outside = entry.outside.as_ref()?;
        self.outside(index, &place.key("outside").key("command"), outside)
    }

    fn ingest(
        &mut self,
        index: usize,
        place: &Place,
        config: &tauscope_ingest::Config,
    ) -> Option<Settings> {
        let (key, source) = match config.source() {
            Ok(source) => source,
            Err(error) => {
                self.report.push(self.file.at_key(place, error.to_string()));
                return None;
            }
        };
        if let Some((title, help)) = source.fault() {
            let problem = self.file.at_key(&place.key(key), title);
            self.report.push(problem.help(help));
        }
        if let (Some(setting), Some(cell)) = (source.gives_amperes(), self.cell(index))
            && cell.facts.effort_unit == EffortUnit::Nm
        {
            let title = format!(
                "the source gives motor currents (`{setting}`), but the cell's effort is in N m"
            );
            let problem = self.file.at_key(&place.key(key), title);
            let name = &cell.facts.name;
            self.report
                .push(problem.help(format!("give the cell `{name}` `effort_unit: A`")));
        }
        let file = source.file();
        let path_place = file.map_or(place.clone(), |(path, _)| place.key(key).key(path));
        let mut config = config.clone();
        if let Some(path) = config.path_mut() {
            *path = self.file.resolve(path);
        }
        let missing = config.path_mut().filter(|path| !is_there(path)).cloned();
        if let (Some(path), Some((_, what))) = (missing, file)
            && self.is_here(index)
        {
            let title = format!("there is no {what} {}", path.display());
            self.report.push(self.file.at(&path_place, title));
            return None;
        }
        let scenario = match &config.simulate {
            Some(simulate) if self.is_here(index) => {
                match ScenarioFacts::load(&simulate.scenario) {
                    Ok(scenario) => Some(scenario),
                    Err(problems) => {
                        self.report.append(problems);
                        return None;
                    }
                }
            }
            _ => None,
        };
        self.try_to_open(index, &path_place, &config, scenario.as_ref());
        self.scenarios
            .extend(scenario.map(|scenario| (index, scenario)));
        Some(Settings::Ingest(Box::new(config)))
    }

    /// Opens a source that reads files as the stage will, so that errors in them are reported before the start.
    fn try_to_open(
        &mut self,
        index: usize,
        place: &Place,
        config: &tauscope_ingest::Config,
        scenario: Option<&ScenarioFacts>,
    ) {
        let Some(cell) = self.cell(index) else { return };
        let is_live = |(_, source): (_, &dyn SourceSettings)| source.file().is_none();
        if config.source().is_ok_and(is_live) || !self.is_here(index) {
            return;
        }
        let opened = scenario
            .map(ScenarioFacts::robot)
            .transpose()
            .map_err(|error| error.to_string())
            .and_then(|robot| {
                build::ingest(config, robot.as_ref(), cell, None).map_err(|error| error.to_string())
            });
        if let Err(text) = opened {
            self.report.push(self.file.at(place, text));
        }
    }

    fn twin_model(&mut self, index: usize) {
        let entry = self.entry(index);
        let Some(path) = entry.twin.as_ref().and_then(|twin| twin.model.as_ref()) else {
            return;
        };
        let path = self.file.resolve(path);
        let place = stage_place(index).key("twin").key("model");
        if !path.exists() {
            let problem = self
                .file
                .at(&place, format!("there is no twin {}", path.display()));
            let help = "`tauscope calibrate` makes one; without `model` the twin is the URDF's";
            self.report.push(problem.help(help));
            return;
        }
        match yaml::load::<TwinFile>(&path) {
            Ok(model) => {
                let wrong = self.cell(index).and_then(|cell| {
                    let facts = &cell.facts;
                    let unit = facts.effort_unit.as_str();
                    model.value.resolve(&facts.joint_names, unit).err()
                });
                if let Some(error) = wrong {
                    self.report.push(self.file.at(&place, error.to_string()));
                    return;
                }
                let hash = provenance::sha256(model.text().as_bytes());
                self.model_sha256.insert(entry.name.clone(), hash);
                self.models.insert(index, model.value);
            }
            Err(problems) => self.report.append(problems),
        }
    }

    fn twin(
        &mut self,
        index: usize,
        place: &Place,
        config: &tauscope_twin::Config,
    ) -> Option<Settings> {
        self.topics_for(index, place, config);
        let model = self.models.get(&index);
        if config.model.is_some() && model.is_none() {
            return None;
        }
        let cell = self.cell(index);
        if let Some(cell) = cell
            && let Err(error) = build::twin(config, model, cell)
        {
            let place = if config.model.is_some() {
                place.key("model")
            } else {
                place.clone()
            };
            self.report
                .push(self.file.at_key(&place, error.to_string()));
            return None;
        }
        let model = model.cloned();
        if let (Some(cell), Some(model)) = (cell, &model) {
            self.model_fits(place, config, model, cell);
        }
        Some(Settings::Twin {
            config: config.clone(),
            model,
        })
    }

    /// Checks that the source reads the topics that the twin needs.
    fn topics_for(&mut self, index: usize, place: &Place, config: &tauscope_twin::Config) {
        let Some(source) = self.above(index, |role| role == Role::Ingest) else {
            return;
        };
        let Some(ingest) = &self.entry(source).ingest else {
            return;
        };
        let Ok((key, settings)) = ingest.source() else {
            return;
        };
        let wanted = config.expected == Expected::Topic;
        if let Some(help) = settings.without_twin().filter(|_| wanted) {
            let title = "the source reads no other twin's effort for this";
            self.report
                .push(self.file.at(&place.key("expected"), title).help(help));
        }
        let Some(topics) = settings.topics() else {
            return;
        };
        let source_place = stage_place(source).key("ingest").key(key).key("topics");
        let wants = [
            (
                config.motion == Motion::Commanded,
                &topics.command,
                "motion",
                "command",
            ),
            (
                config.expected == Expected::Topic,
                &topics.twin,
                "expected",
                "twin",
            ),
        ];
        for (wanted, topic, twin_key, topic_key) in wants {
            if wanted && topic.is_none() {
                let name = &self.entry(source).name;
                let title = format!("the source `{name}` reads no `{topic_key}` topic for this");
                let problem = self
                    .file
                    .at(&place.key(twin_key), title)
                    .also(self.file.key_span(&source_place), "its topics")
                    .help(format!("name it there: `{topic_key}: /its/name`"));
                self.report.push(problem);
            }
        }
    }

    fn watch(
        &mut self,
        index: usize,
        place: &Place,
        config: &tauscope_watch::Config,
    ) -> Option<Settings> {
        let twin = self.above(index, |role| role == Role::Twin);
        let model = twin.and_then(|twin| self.models.get(&twin));
        let twin_config = twin.and_then(|twin| self.entry(twin).twin.clone());
        let twin_config = twin_config.unwrap_or_default();
        if twin_config.model.is_some() && model.is_none() {
            // The twin's model is invalid, which is already reported.
            return None;
        }
        let effort_cutoff_hz = twin_config
            .filters(model.map(|model| model.filters))
            .effort_cutoff_hz;
        let mut config = config.clone();
        if let Some(path) = &mut config.state {
            *path = self.file.resolve(path);
        }
        if let Some(cell) = self.cell(index) {
            if let Err(error) = build::watch(&config, model, effort_cutoff_hz, cell) {
                self.report.push(self.file.at_key(place, error.to_string()));
                return None;
            }
            let joints = cell.facts.joint_names.len();
            let state = config.state.as_ref().filter(|_| self.is_here(index));
            if let Some(Err(problems)) = state.map(|path| learnt_state::of_watch(path, joints)) {
                self.report.append(problems);
                return None;
            }
        }
        Some(Settings::Watch {
            config,
            model: model.cloned(),
            effort_cutoff_hz,
        })
    }

    fn outside(&mut self, index: usize, place: &Place, outside: &OutsideEntry) -> Option<Settings> {
        let mut outside = outside.clone();
        let program = outside.command.first_mut()?;
        if program.contains('/') {
            let path = self.file.resolve(Path::new(program.as_str()));
            if self.is_here(index) && !path.is_file() {
                let title = format!("there is no program {}", path.display());
                self.report.push(self.file.at(&place.index(0), title));
                return None;
            }
            // Absolute, because the program is started in the folder of the pipeline file.
            let path = std::path::absolute(&path).unwrap_or(path);
            *program = path.display().to_string();
        }
        Some(Settings::Outside(outside))
    }
}
