//! Watchdog: polls every 250 ms for stages that are silent, hung, not ready or not terminating, and reports them.

use std::time::Duration;

use tauscope_bus::Trouble;
use tauscope_pipeline::suggest;
use tokio::time::Instant;

use super::local::Local;
use super::patience::Overdue;
use super::view::Row;
use super::{Ended, Supervisor};

/// Time without samples after which a stage with inputs from other hosts is treated as silent; a source reports its
/// own silence.
const SILENT_AFTER: Duration = Duration::from_secs(4);
/// Time after which a stage that is not ready is reported.
const BEGUN_WITHIN: Duration = Duration::from_secs(4);
/// Time that a source needs to find the reason for missing data; a run that ends without data waits for it.
const REASON_WITHIN: Duration = Duration::from_secs(5);

impl Supervisor<'_> {
    pub(super) fn look(&mut self, now: Instant) {
        if !self.stopping {
            self.tell_who_does_not_begin(now);
            self.tell_who_is_silent(now);
            self.tell_who_hangs(now);
            self.end_without_data(now);
            self.end_in_time(now);
        }
        self.tell_who_does_not_end(now);
        self.tell_service(now);
        let stages = &self.stages;
        self.view.show(now.into_std(), || {
            stages.iter().map(|stage| row(stage, now)).collect()
        });
    }

    fn tell_who_is_silent(&mut self, now: Instant) {
        for index in 0..self.stages.len() {
            let stage = &self.stages[index];
            let silent_for = stage.flow.silent_for(now.into_std());
            let trouble = if stage.is_over() {
                None
            } else if stage.is_source() {
                stage.trouble().cloned()
            } else {
                self.remote_trouble(index, silent_for)
            };
            let stage = &mut self.stages[index];
            // A process that was just restarted has not reported its state yet.
            if trouble.is_none() && stage.silence.trouble().is_some() && silent_for > SILENT_AFTER {
                continue;
            }
            let said = stage
                .silence
                .note(trouble.as_ref(), silent_for, now.into_std());
            let name = &stage.seat.stage;
            match said {
                Some((true, text)) => self.view.warn(&format!("warning: stage `{name}`: {text}")),
                Some((false, text)) => self.view.note(&format!("note: stage `{name}`: {text}")),
                None => {}
            }
        }
    }

    /// Returns the trouble of a silent stage whose inputs all come from other hosts.
    fn remote_trouble(&self, index: usize, silent_for: Duration) -> Option<Trouble> {
        let stage = &self.stages[index];
        let inputs = &self.pipeline.stages[stage.at].inputs;
        let is_local = |at: &usize| self.stages.iter().any(|stage| stage.at == *at);
        if silent_for < SILENT_AFTER || !stage.is_ready() || inputs.iter().any(is_local) {
            return None;
        }
        let senders: Vec<_> = inputs.iter().map(|&at| &self.pipeline.stages[at]).collect();
        let mut hosts: Vec<&str> = senders
            .iter()
            .filter_map(|stage| stage.host.as_deref())
            .collect();
        hosts.dedup();
        let what = "nothing comes from the other hosts";
        let expected = senders.iter().map(|sender| {
            let host = sender.host.as_deref().unwrap_or_default();
            format!(
                "stream {} of stage `{}` on host `{host}`",
                sender.stream(),
                sender.name
            )
        });
        let file = self.pipeline.path.display();
        let mut endpoints = (self.pipeline.hosts.values())
            .flat_map(|host| host.listen.0.iter().chain(&host.connect.0));
        let certificates = if endpoints.any(|endpoint| endpoint.starts_with("tls/")) {
            "; or one of the hosts shows a certificate of another cell, and the router lets none of this cell's \
             streams through"
        } else {
            ""
        };
        let remedy = hosts.first().map(|host| {
            format!(
                "{} not running (`tauscope run {file} --host {host}`), without data of its own, or not \
                 reachable at the addresses under `hosts`{certificates}",
                suggest::list(hosts.iter().copied())
            )
        });
        Some(Trouble::new(what).expects(expected).likely(remedy))
    }

    fn tell_who_does_not_begin(&mut self, now: Instant) {
        if self.told_unready || now.duration_since(self.began) < BEGUN_WITHIN {
            return;
        }
        self.told_unready = true;
        let mut waiting = self
            .stages
            .iter()
            .filter(|stage| !stage.is_ready() && !stage.is_over());
        // Readiness propagates from the recorders to the sources: the stage nearest to the recorders holds up the
        // others.
        let Some(stage) = waiting.next_back() else {
            return;
        };
        let name = &stage.seat.stage;
        let mut listeners = Vec::new();
        for listener in &self.pipeline.stages {
            let hears = listener.inputs.contains(&stage.at);
            let here = self
                .stages
                .iter()
                .find(|each| self.pipeline.stages[each.at].name == listener.name);
            if hears && here.is_none_or(|here| !here.is_ready()) {
                let host = listener.host.as_deref();
                let on = host.map_or_else(String::new, |host| format!(" on host `{host}`"));
                listeners.push(format!("`{}`{on}", listener.name));
            }
        }
        let waits = match &listeners[..] {
            [] => String::new(),
            all => format!(": it waits for {}, which must listen first", all.join(", ")),
        };
        let seconds = BEGUN_WITHIN.as_secs();
        self.view.warn(&format!(
            "warning: stage `{name}` has not begun after {seconds} s{waits}"
        ));
    }

    /// Ends the run if a source is silent for longer than `--expect-data` allows.
    fn end_without_data(&mut self, now: Instant) {
        let Some(limit) = self.care.expect_data else {
            return;
        };
        let late = self.stages.iter().find(|stage| {
            let silent_for = stage.flow.silent_for(now.into_std());
            let has_reason =
                stage.silence.trouble().is_some() || silent_for > limit + REASON_WITHIN;
            let is_entry = stage.is_source() || self.is_fed_by_other_hosts(stage);
            is_entry && !stage.is_over() && silent_for >= limit && has_reason
        });
        let Some(stage) = late else {
            return;
        };
        let (name, seconds) = (&stage.seat.stage, limit.as_secs_f64());
        let since = if stage.flow.count() == 0 {
            ""
        } else {
            " after the last one"
        };
        let why = match stage.silence.trouble() {
            Some(trouble) => format!(": {}", trouble.what),
            None => String::new(),
        };
        self.view.warn(&format!(
            "error: stage `{name}` gave no usable sample within {seconds} s{since} (--expect-data){why}"
        ));
        self.ended = Ended::NoData;
        self.stop();
    }

    /// Ends the run after the requested duration of data.
    fn end_in_time(&mut self, now: Instant) {
        let mut sources = self.stages.iter().filter(|stage| stage.is_source());
        if self.first_sample.is_none() && sources.any(|stage| stage.flow.count() > 0) {
            self.first_sample = Some(now);
        }
        let lasted = self.first_sample.map(|first| now.duration_since(first));
        if let (Some(lasted), Some(limit)) = (lasted, self.care.for_data)
            && lasted >= limit
        {
            self.stop();
        }
    }

    fn is_fed_by_other_hosts(&self, stage: &Local) -> bool {
        let inputs = &self.pipeline.stages[stage.at].inputs;
        let is_local = |at: &usize| self.stages.iter().any(|stage| stage.at == *at);
        !inputs.is_empty() && !inputs.iter().any(is_local)
    }

    fn tell_who_does_not_end(&mut self, now: Instant) {
        for index in 0..self.stages.len() {
            let stage = &mut self.stages[index];
            let overdue = stage.overdue(now);
            let name = &stage.seat.stage;
            match overdue {
                Some(Overdue::Name(left)) => {
                    let left = left.as_secs_f64();
                    self.view.warn(&format!(
                        "warning: stage `{name}` was asked to end and still runs; it is killed in {left:.0} s"
                    ));
                }
                Some(Overdue::Kill) => self.kill_stubborn(index),
                None => {}
            }
        }
        for worker in &mut self.workers {
            worker.kill_if_it_stays(now);
        }
    }
}

fn row(stage: &Local, now: Instant) -> Row {
    let sums = stage.tally.sums();
    let lost: u64 = sums.inputs.iter().map(|input| input.lost).sum();
    Row {
        stage: stage.seat.stage.clone(),
        received: stage.flow.count(),
        rate_hz: stage.flow.rate_hz(now.into_std()),
        age: stage.flow.age(now.into_std()),
        dropped: lost + sums.refused,
        fraction_done: stage.fraction_done(),
        holds: stage.holds.clone(),
    }
}
