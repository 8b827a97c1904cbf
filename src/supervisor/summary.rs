//! What came of a run: a line for each stage and each link.

use std::path::PathBuf;

use comfy_table::{CellAlignment, Table, presets};
use serde::Serialize;
use tauscope_bus::{SampleKind, Trouble};
use tauscope_pipeline::pipeline::Pipeline;

use super::local::Local;
use crate::exit::Exit;
use crate::plan::{Link, Over};

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// Its sources came to their end, or a stage failed.
    Completed,
    /// Ctrl-C or SIGTERM.
    Interrupted,
    /// No data came within the time of `--expect-data`.
    NoData,
}

/// What came of a run on this host.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// Why it ended.
    pub ended: Ended,
    /// The stages of this host, in the order of the pipeline.
    pub stages: Vec<StageSummary>,
    /// The links of this host, by what their receiving ends counted; a link to another host by what
    /// its sending end counted.
    pub links: Vec<LinkSummary>,
}

/// One stage.
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a key of the JSON, or known beside them"
)]
#[derive(Debug, Clone, Serialize)]
pub struct StageSummary {
    /// Its name.
    pub stage: String,
    /// Whether it listens to nobody.
    #[serde(skip)]
    is_source: bool,
    /// Whether it ever said what it has done: a program that is not ours may not.
    pub reported: bool,
    /// Samples that came in; for a source, those it read.
    pub received: u64,
    /// Samples that went out.
    pub emitted: u64,
    /// Samples lost on the way to it, and those it had to refuse.
    pub dropped: u64,
    /// How often it was started again.
    pub restarts: u64,
    /// Whether it was given up.
    pub failed: bool,
    /// Whether it did not end when it was told to, and was killed.
    pub killed: bool,
    /// What kept it from getting anything it could use, to the end.
    pub trouble: Option<Trouble>,
    /// The files that a recorder completed last.
    pub files: Vec<PathBuf>,
    /// How many files a recorder completed.
    pub files_completed: u64,
}

/// One link.
#[derive(Debug, Clone, Serialize)]
pub struct LinkSummary {
    /// The stage it comes from.
    pub from: String,
    /// The stage it goes to.
    pub to: String,
    /// What it ran over.
    pub over: Over,
    /// Samples sent, where the sender is here.
    pub emitted: Option<u64>,
    /// Samples received, where the receiver is here.
    pub received: Option<u64>,
    /// Samples that did not arrive.
    pub dropped: u64,
}

impl Summary {
    /// Adds up what the stages have reported.
    pub fn new(pipeline: &Pipeline, links: &[Link], stages: &[Local], ended: Ended) -> Self {
        let mut summary = Self::reported(pipeline, links, stages, ended);
        summary.count_what_was_missed();
        for at in 0..summary.stages.len() {
            summary.count_unreported(at);
        }
        summary
    }

    /// A stage that was killed has sent more than it lived to report, as its listeners know. Those in its process heard
    /// each sample before anybody else did, and died with it.
    fn count_unreported(&mut self, at: usize) {
        let Self { stages, links, .. } = self;
        let StageSummary {
            restarts, failed, ..
        } = stages[at];
        if restarts == 0 && !failed {
            return;
        }
        let name = stages[at].stage.clone();
        let mine = |link: &&mut LinkSummary| link.from == name;
        let known = links.iter_mut().filter(mine);
        let known = known.map(|link| link.received.map_or(0, |received| received + link.dropped));
        let emitted = stages[at].emitted.max(known.max().unwrap_or(0));
        stages[at].emitted = emitted;
        for link in links.iter_mut().filter(mine) {
            link.emitted = Some(emitted);
            if link.over != Over::InProcess {
                continue;
            }
            link.received = Some(emitted - link.dropped.min(emitted));
            let listener = stages.iter_mut().find(|stage| stage.stage == link.to);
            if let (Some(listener), Some(received)) = (listener, link.received) {
                listener.received = received;
            }
        }
    }

    /// What went to a stage while it was not there is lost, too, though nobody has seen a hole: it died and was not back
    /// yet, or had no further life, or came later than the one it hears would wait.
    fn count_what_was_missed(&mut self) {
        for stage in self.stages.iter_mut().filter(|stage| stage.reported) {
            for link in self.links.iter_mut().filter(|link| link.to == stage.stage) {
                // Nothing is on its way there, and both ends live and die together.
                if link.over == Over::InProcess {
                    continue;
                }
                let (Some(emitted), Some(received)) = (link.emitted, link.received) else {
                    continue;
                };
                let missed = emitted.saturating_sub(received + link.dropped);
                link.dropped += missed;
                stage.dropped += missed;
            }
        }
    }

    fn reported(pipeline: &Pipeline, links: &[Link], stages: &[Local], ended: Ended) -> Self {
        let here = |at: usize| stages.iter().find(|stage| stage.at == at);
        let links = links.iter().filter_map(|link| {
            let (sender, receiver) = (here(link.from), here(link.to));
            if sender.is_none() && receiver.is_none() {
                return None;
            }
            let emitted = sender.map(|stage| stage.tally.sums().emitted);
            let counts = receiver.map(|stage| {
                let is_it = |input: &tauscope_bus::seat::Input| input.stream == link.stream;
                let place = stage.seat.inputs.iter().position(is_it);
                let counts = stage.tally.sums().inputs;
                place
                    .and_then(|place| counts.get(place).copied())
                    .unwrap_or_default()
            });
            // What another host received is known there; here, what its stages were not there for.
            let undelivered = || sender.map_or(0, |stage| stage.tally.sums().undelivered);
            Some(LinkSummary {
                from: pipeline.stages[link.from].name.clone(),
                to: pipeline.stages[link.to].name.clone(),
                over: link.over,
                emitted,
                received: counts.map(|counts| counts.received),
                dropped: counts.map_or_else(undelivered, |counts| counts.lost),
            })
        });
        Self {
            ended,
            links: links.collect(),
            stages: stages.iter().map(StageSummary::new).collect(),
        }
    }

    /// How the run ended.
    pub fn exit(&self) -> Exit {
        if self.ended == Ended::NoData || self.stages.iter().any(|stage| stage.failed) {
            return Exit::Failed;
        }
        let dropped = self.stages.iter().any(|stage| stage.dropped > 0);
        Exit::from_loss(dropped || self.links.iter().any(|link| link.dropped > 0))
    }

    /// As tables.
    pub fn table(&self) -> String {
        let mut stages = new(&["stage", "received", "emitted", "dropped", "restarts"]);
        for stage in &self.stages {
            let count = |count: u64| {
                if stage.reported {
                    count.to_string()
                } else {
                    "?".to_owned()
                }
            };
            let failed = match (stage.killed, stage.failed) {
                (true, _) => " (did not end: killed)",
                (false, true) => " (failed)",
                (false, false) => "",
            };
            stages.add_row([
                format!("{}{failed}", stage.stage),
                count(stage.received),
                count(stage.emitted),
                count(stage.dropped),
                stage.restarts.to_string(),
            ]);
        }
        let mut links = new(&["link", "emitted", "received", "dropped"]);
        for link in &self.links {
            let over = match link.over {
                Over::InProcess => " (in process)",
                Over::SharedMemory => "",
                Over::Zenoh => " (Zenoh)",
            };
            let count = |count: Option<u64>| count.map_or(String::new(), |count| count.to_string());
            links.add_row([
                format!("{} -> {}{over}", link.from, link.to),
                count(link.emitted),
                count(link.received),
                link.dropped.to_string(),
            ]);
        }
        for table in [&mut stages, &mut links] {
            for column in table.column_iter_mut().skip(1) {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        let mut text = format!("{}\n\n{}", stages.trim_fmt(), links.trim_fmt());
        for stage in &self.stages {
            let name = &stage.stage;
            let when = if stage.received == 0 {
                ""
            } else {
                " at the end"
            };
            match &stage.trouble {
                Some(trouble) => {
                    text += &format!("\n\nwarning: stage `{name}` got no sample{when}: {trouble}");
                }
                None if stage.is_source && stage.reported && stage.received == 0 => {
                    text += &format!("\n\nwarning: stage `{name}` got no sample");
                }
                None => {}
            }
        }
        text
    }
}

impl StageSummary {
    fn new(stage: &Local) -> Self {
        let sums = stage.tally.sums();
        let inputs = stage.seat.inputs.iter().zip(&sums.inputs);
        // Health reports come along with what is recorded; they are not what is asked for here.
        let data = inputs.filter(|(input, _)| input.kind != SampleKind::Health);
        let (mut received, mut lost) = (0, 0);
        for (_, counts) in data {
            received += counts.received;
            lost += counts.lost;
        }
        if stage.seat.inputs.is_empty() {
            received = sums.emitted + sums.refused;
        }
        Self {
            stage: stage.seat.stage.clone(),
            is_source: stage.is_source(),
            reported: stage.tally.is_known(),
            received,
            emitted: sums.emitted,
            dropped: lost + sums.refused,
            restarts: stage.seat.restarts,
            failed: stage.is_lost(),
            killed: stage.was_killed(),
            trouble: stage.silence.trouble().cloned(),
            files: stage.tally.newest().files.clone(),
            files_completed: sums.files_completed,
        }
    }
}

fn new(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_preset(presets::UTF8_FULL_CONDENSED)
        .set_header(header);
    table
}
