//! Summary of a run: a line for each stage and each link.

use std::path::PathBuf;

use comfy_table::{CellAlignment, Table, presets};
use serde::Serialize;
use tauscope_bus::{ReceiverCounts, SampleKind, Trouble};
use tauscope_pipeline::pipeline::Pipeline;
use tauscope_pipeline::pipeline::Settings;
use tauscope_pipeline::pipeline::stages::ingest::IngestSettings;

use super::local::Local;
use crate::exit::Exit;
use crate::plan::{Link, Over};

/// Reason for the end of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// Its sources ended, or a stage failed.
    Completed,
    /// Ctrl-C or SIGTERM.
    Interrupted,
    /// No data came within the time of `--expect-data`.
    NoData,
}

/// Summary of a run on this host.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// Reason for its end.
    pub ended: Ended,
    /// The stages of this host, in the order of the pipeline.
    pub stages: Vec<StageSummary>,
    /// The links of this host, as counted by their receivers; links to other hosts, as counted by their senders.
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
    /// Whether it has no inputs.
    #[serde(skip)]
    is_source: bool,
    /// Whether it ever reported its counts; an external program may not.
    pub reported: bool,
    /// Samples that came in; for a source, those it read.
    pub received: u64,
    /// Samples that went out.
    pub emitted: u64,
    /// Samples lost on the way to it, and those it had to refuse.
    pub dropped: u64,
    /// Number of restarts.
    pub restarts: u64,
    /// Whether it was given up.
    pub failed: bool,
    /// Whether it was killed because it did not end when asked to.
    pub killed: bool,
    /// Whether it is a live source that was restarted: what its robot sent meanwhile is lost and not counted.
    pub unknown_loss: bool,
    /// Reason why it received nothing usable, if it lasted to the end.
    pub trouble: Option<Trouble>,
    /// The files that a recorder completed last.
    pub files: Vec<PathBuf>,
    /// Number of files that a recorder completed.
    pub files_completed: u64,
}

/// One link. Emitted = received + dropped, to the sample.
#[derive(Debug, Clone, Serialize)]
pub struct LinkSummary {
    /// Sending stage.
    pub from: String,
    /// Receiving stage.
    pub to: String,
    /// Transport.
    pub over: Over,
    /// Samples sent; if the sender is on another host, as far as the receiver knows.
    pub emitted: Option<u64>,
    /// Samples received, if the receiver is on this host.
    pub received: Option<u64>,
    /// Samples that did not arrive, or that the receiver refused.
    pub dropped: u64,
    /// Whether the receiver, if it is on this host, has received the end of the stream; if not, more samples may have
    /// been sent.
    pub ended: Option<bool>,
    /// Refused messages that are not from the sender.
    pub foreign: u64,
    /// Samples received but never sent: more than 0 only if the counts are wrong.
    pub surplus: u64,
}

impl Summary {
    /// Sums up the reports of the stages.
    pub fn new(pipeline: &Pipeline, links: &[Link], stages: &[Local], ended: Ended) -> Self {
        let here = |at: usize| stages.iter().find(|stage| stage.at == at);
        let name = |at: usize| pipeline.stages[at].name.clone();
        let mut summary = Self {
            ended,
            links: Vec::new(),
            stages: (stages.iter())
                .map(|stage| StageSummary::new(stage, &pipeline.stages[stage.at].settings))
                .collect(),
        };
        for link in links {
            let books = Books {
                sender: here(link.from),
                receiver: here(link.to),
                link,
            };
            let counted = books.balance();
            summary.links.extend(counted.map(|counted| LinkSummary {
                from: name(link.from),
                to: name(link.to),
                over: link.over,
                ..counted
            }));
        }
        for stage in &mut summary.stages {
            let mine = summary.links.iter().filter(|link| link.to == stage.stage);
            stage.dropped += mine.map(|link| link.dropped).sum::<u64>();
        }
        summary
    }

    /// Returns the outcome of the run.
    pub fn exit(&self) -> Exit {
        let stages = &self.stages;
        if self.ended == Ended::NoData || self.is_empty() || stages.iter().any(|it| it.failed) {
            return Exit::Failed;
        }
        let dropped = stages.iter().any(|it| it.dropped > 0 || it.unknown_loss);
        let balances = |link: &LinkSummary| link.dropped == 0 && link.surplus == 0;
        let whole = |link: &LinkSummary| balances(link) && link.ended != Some(false);
        Exit::from_loss(dropped || !self.links.iter().all(whole))
    }

    /// Returns whether this host has sources and all of them ended without a sample, so that the run did nothing.
    fn is_empty(&self) -> bool {
        let mut sources = self.stages.iter().filter(|stage| stage.is_source);
        let is_there = self.stages.iter().any(|stage| stage.is_source);
        is_there && sources.all(|stage| stage.reported && stage.received == 0)
    }

    /// Formats the summary as tables, with warnings.
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
                " got no sample"
            } else {
                ", at the end"
            };
            match &stage.trouble {
                Some(trouble) => {
                    text += &format!("\n\nwarning: stage `{name}`{when}: {trouble}");
                }
                None if stage.is_source && stage.reported && stage.received == 0 => {
                    text += &format!("\n\nwarning: stage `{name}` got no sample");
                }
                None => {}
            }
        }
        for line in self.warnings() {
            text += &format!("\n\nwarning: {line}");
        }
        text
    }

    /// Returns further warnings: no samples, uncounted losses, incomplete streams, refused messages, wrong counts.
    fn warnings(&self) -> Vec<String> {
        let mut lines = Vec::new();
        if self.is_empty() {
            let nothing = "nothing came in: this run has watched nothing and recorded nothing";
            lines.push(nothing.to_owned());
        }
        for stage in self.stages.iter().filter(|stage| stage.unknown_loss) {
            let name = &stage.stage;
            lines.push(format!(
                "stage `{name}` was restarted: samples that its robot sent meanwhile are lost and not counted"
            ));
        }
        for link in &self.links {
            let LinkSummary { from, to, .. } = link;
            // Not worth a warning if the receiver failed.
            let has_failed = |it: &StageSummary| it.stage == *to && it.failed;
            if link.ended == Some(false) && !self.stages.iter().any(has_failed) {
                lines.push(format!(
                    "stage `{to}` has not heard the end of the stream of `{from}`: more may have been sent"
                ));
            }
            if link.foreign > 0 {
                let foreign = link.foreign;
                lines.push(format!(
                    "{foreign} messages in the stream of `{from}` to `{to}` were not from `{from}`, and were refused"
                ));
            }
            if link.surplus > 0 {
                let surplus = link.surplus;
                lines.push(format!(
                    "stage `{to}` has received {surplus} samples more than `{from}` has sent: the counts are wrong"
                ));
            }
        }
        lines
    }
}

/// The ends of a link that are on this host.
struct Books<'a> {
    sender: Option<&'a Local>,
    receiver: Option<&'a Local>,
    link: &'a Link,
}

impl Books<'_> {
    /// Balances the counts of both ends; `None` for a link between other hosts.
    fn balance(&self) -> Option<LinkSummary> {
        let sender = self.sender.filter(|stage| stage.tally.is_known());
        let receiver = self.receiver.filter(|stage| stage.tally.is_known());
        if self.sender.is_none() && self.receiver.is_none() {
            return None;
        }
        let sent = sender.map(|stage| stage.tally.sums());
        let heard = receiver.map(|stage| self.heard(stage));
        let (counts, ended) = heard.unwrap_or_default();
        let emitted = match &sent {
            Some(sums) => Some(sums.emitted),
            None => heard.map(|_| counts.received.saturating_add(counts.dropped())),
        };
        let dropped = match (&sent, heard) {
            (Some(sums), Some(_)) => sums.emitted.saturating_sub(counts.received),
            // The counts of a receiver on another host are not known here; those that it has not acknowledged are.
            (Some(sums), None) => sums.undelivered.min(sums.emitted),
            _ => counts.dropped(),
        };
        let surplus = match &sent {
            Some(sums) => counts.received.saturating_sub(sums.emitted),
            None => 0,
        };
        Some(LinkSummary {
            from: String::new(),
            to: String::new(),
            over: self.link.over,
            emitted,
            received: heard.map(|_| counts.received),
            dropped,
            ended: heard.map(|_| ended),
            foreign: counts.foreign,
            surplus,
        })
    }

    /// Returns the receiver's counts, and whether the stream has ended, over all incarnations of its sender.
    fn heard(&self, receiver: &Local) -> (ReceiverCounts, bool) {
        let is_it = |input: &tauscope_bus::seat::Input| input.stream == self.link.stream;
        let Some(place) = receiver.seat.inputs.iter().position(is_it) else {
            return <_>::default();
        };
        let counts = receiver.tally.sums().inputs;
        let newest = receiver.tally.newest().inputs.get(place);
        let counts = counts.get(place).copied().unwrap_or_default();
        let ended = newest.is_some_and(|input| input.ended) && counts.broken_off == 0;
        (counts, ended)
    }
}

impl StageSummary {
    fn new(stage: &Local, settings: &Settings) -> Self {
        let sums = stage.tally.sums();
        let inputs = stage.seat.inputs.iter().zip(&sums.inputs);
        // Health reports accompany the recorded samples, and are not counted here.
        let data = inputs.filter(|(input, _)| input.kind != SampleKind::Health);
        let mut received = data.map(|(_, counts)| counts.received).sum();
        if stage.seat.inputs.is_empty() {
            received = sums.emitted + sums.refused;
        }
        Self {
            stage: stage.seat.stage.clone(),
            is_source: stage.is_source(),
            reported: stage.tally.is_known(),
            received,
            emitted: sums.emitted,
            dropped: sums.refused,
            restarts: stage.seat.restarts,
            failed: stage.is_lost(),
            killed: stage.was_killed(),
            unknown_loss: is_live_source(settings) && stage.seat.restarts > 0,
            trouble: stage.silence.trouble().cloned(),
            files: stage.tally.newest().files.clone(),
            files_completed: sums.files_completed,
        }
    }
}

/// Returns whether a stage receives from a robot, which does not wait for it; of an external program this is not
/// known.
fn is_live_source(settings: &Settings) -> bool {
    let source = settings.get::<IngestSettings>();
    source.is_some_and(|source| !source.reads_file())
}

fn new(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_preset(presets::UTF8_FULL_CONDENSED)
        .set_header(header);
    table
}
