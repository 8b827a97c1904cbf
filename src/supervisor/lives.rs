//! Life cycle of processes and of the stage groups in them: start, end and restart.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitStatus;
use std::time::Duration;

use serde::Deserialize;
use tauscope_bus::Seat;
use tauscope_pipeline::pipeline::{Pipeline, Placement};
use tokio::time::Instant;

use super::Supervisor;
use super::local::{FAILED, Local};
use super::process::{self, Process};
use super::worker::Worker;
use crate::plan::{self, Link};

/// Returns the stages with these seats, and the processes in which they run.
pub(super) fn workers(
    pipeline: &Pipeline,
    links: &[Link],
    seats: Vec<(usize, Seat)>,
) -> (Vec<Local>, Vec<Worker>) {
    let roots = plan::roots(pipeline, links);
    let here: BTreeMap<usize, usize> = seats
        .iter()
        .enumerate()
        .map(|(index, (at, _))| (*at, index))
        .collect();
    let (mut stages, mut workers) = (Vec::new(), Vec::<Worker>::new());
    for (index, (at, seat)) in seats.into_iter().enumerate() {
        let stage = &pipeline.stages[at];
        let place = workers
            .iter()
            .position(|worker| worker.name == stage.process);
        let place = place.unwrap_or_else(|| {
            let outside = stage.role.kind.placement == Placement::Program;
            workers.push(Worker::new(&stage.process, outside));
            workers.len() - 1
        });
        workers[place].stages.push(index);
        // All stages of a group are on one host.
        let root = here.get(&roots[at]).copied().unwrap_or(index);
        stages.push(Local::new(at, seat, place, root));
    }
    // The stages of a group fail together, so the strictest of their restart policies applies.
    for index in 0..stages.len() {
        let policy = pipeline.stages[stages[index].at].restart;
        let root = stages[index].root;
        stages[root].restart_by(policy);
    }
    (stages, workers)
}

impl Supervisor<'_> {
    /// Starts all stages, receivers before senders, so that few have to wait for long.
    pub(super) fn start_all(&mut self) -> anyhow::Result<()> {
        for index in (0..self.stages.len()).rev() {
            if self.stages[index].root == index {
                self.start(index)?;
            }
        }
        Ok(())
    }

    /// Starts a group, and its process if it does not run.
    pub(super) fn start(&mut self, root: usize) -> anyhow::Result<()> {
        let group = self.group(root);
        let seats: Vec<&Seat> = group
            .iter()
            .map(|&index| &self.stages[index].seat)
            .collect();
        let place = self.stages[root].worker;
        let worker = &mut self.workers[place];
        let line = worker.line(&seats)?;
        let id = if let Some(process) = worker.process() {
            process.tell(line);
            process.id()
        } else {
            let settings = &self.pipeline.stages[self.stages[root].at].settings;
            let folder = self.pipeline.path.parent().unwrap_or(Path::new(""));
            let command = process::command(settings, folder)?;
            // Per stage the seats of a group and a request to end, and the same once more.
            let most_told = 4 * worker.stages.len() + 2;
            let (name, mark) = (worker.name.clone(), (place, worker.life));
            let events = self.sender.clone();
            let process = Process::start(command, &name, line, most_told, mark, events)?;
            let id = process.id();
            worker.started(process);
            id
        };
        for index in group.into_iter().rev() {
            let stage = &mut self.stages[index];
            stage.started();
            let name = &stage.seat.stage;
            self.view
                .note(&format!("stage `{name}` runs as process {id}"));
        }
        Ok(())
    }

    /// Returns the stages of a group, its root first.
    pub(super) fn group(&self, root: usize) -> Vec<usize> {
        let all = 0..self.stages.len();
        all.filter(|&index| self.stages[index].root == root)
            .collect()
    }

    /// Returns whether nothing runs and nothing will be started.
    pub(super) fn is_over(&self) -> bool {
        self.stages.iter().all(Local::is_over)
            && self.workers.iter().all(|worker| worker.process().is_none())
    }

    /// Returns the stage of a process that a line is from.
    pub(super) fn speaker(&self, worker: usize, line: &str) -> Option<usize> {
        #[derive(Deserialize)]
        struct Named {
            stage: String,
        }
        let worker = &self.workers[worker];
        if let [only] = worker.stages.as_slice() {
            return Some(*only);
        }
        let named: Named = serde_json::from_str(line).ok()?;
        let mut stages = worker.stages.iter().copied();
        stages.find(|&index| self.stages[index].seat.stage == named.stage)
    }

    /// Ends a group if all of its stages have reported their end.
    pub(super) fn group_ended(&mut self, root: usize) {
        let group = self.group(root);
        let over = |&index: &usize| {
            let stage = &self.stages[index];
            stage.is_done() || !stage.is_running()
        };
        if group.iter().all(over) {
            self.over(&group, None);
            self.settle();
        }
    }

    /// Handles the exit of a process, after all of its output.
    pub(super) fn process_ended(&mut self, worker: usize, status: &std::io::Result<ExitStatus>) {
        let stages = self.workers[worker].stages.clone();
        let in_order = status.as_ref().is_ok_and(ExitStatus::success);
        if let ([only], true, true) = (stages.as_slice(), self.workers[worker].outside, in_order)
            && !self.stages[*only].was_killed()
            && !self.stages[*only].returns_always()
        {
            self.stages[*only].end();
            return;
        }
        for root in stages {
            if self.stages[root].root == root && self.stages[root].is_running() {
                let group = self.group(root);
                self.over(&group, Some(status));
            }
        }
    }

    /// Ends or restarts a group that is over; `exit` is the exit status of its process, if that has exited.
    fn over(&mut self, group: &[usize], exit: Option<&std::io::Result<ExitStatus>>) {
        let running: Vec<usize> = (group.iter().copied())
            .filter(|&index| self.stages[index].is_running())
            .collect();
        let deaths: Vec<Option<String>> = running
            .iter()
            .map(|&index| self.stages[index].death(exit))
            .collect();
        if deaths.iter().all(Option::is_none) {
            for index in running {
                self.stages[index].end();
            }
            return;
        }
        self.clean();
        let may_return = running.iter().all(|&index| self.stages[index].may_return());
        let root = running.first().map(|&index| self.stages[index].root);
        let again = root
            .filter(|_| may_return)
            .and_then(|root| self.stages[root].note_death());
        let mut with_it = Vec::new();
        for (index, how) in running.into_iter().zip(deaths) {
            let stage = &mut self.stages[index];
            let name = &stage.seat.stage;
            match how.filter(|_| !stage.fell_with_another()) {
                Some(how) => self.view.warn(&died(name, &how, again)),
                None => with_it.push(format!("`{name}`")),
            }
            stage.die(again);
        }
        // Report the consequences after the cause.
        if !with_it.is_empty() {
            self.view.warn(&fell_with_it(&with_it.join(", "), again));
        }
        if again.is_none() {
            self.stop();
        }
    }

    /// Closes the processes that have nothing left to do.
    pub(super) fn close_workers(&mut self) {
        for worker in &mut self.workers {
            let mut stages = worker.stages.iter().map(|&index| &self.stages[index]);
            if !worker.outside && stages.all(Local::is_over) {
                worker.close(Instant::now());
            }
        }
    }

    /// Asks a stage, and its group, to end.
    pub(super) fn ask_to_end(&mut self, index: usize, recorder: bool) {
        if self.stages[index].is_to_end(recorder) {
            let stage = &self.stages[index];
            self.workers[stage.worker].stop(&stage.seat.stage);
        }
    }

    /// Ends a stage that does not end itself: kills its process or, if other stages still run in it, gives up its
    /// group.
    pub(super) fn kill_stubborn(&mut self, index: usize) {
        let Local { worker, root, .. } = self.stages[index];
        let group = self.group(root);
        for &index in &group {
            self.stages[index].is_killed();
        }
        let mut others = self.workers[worker].stages.iter();
        if others.all(|other| group.contains(other) || self.stages[*other].is_over()) {
            self.workers[worker].kill();
            return;
        }
        self.over(&group, None);
        self.settle();
    }
}

fn died(name: &str, how: &str, again: Option<Duration>) -> String {
    match again {
        // The stage's own reason is a sentence of its own.
        None if how.starts_with(FAILED) => {
            format!("error: stage `{name}` {how}\n  it is not started again, and the run ends")
        }
        None => format!("error: stage `{name}` {how} and is not started again"),
        Some(Duration::ZERO) => format!("warning: stage `{name}` {how}: starting it again"),
        Some(wait) => {
            let wait = wait.as_millis();
            format!("warning: stage `{name}` {how}: starting it again in {wait} ms")
        }
    }
}

/// Describes stages that ended because another one of their group did.
fn fell_with_it(names: &str, again: Option<Duration>) -> String {
    match again {
        None => format!("  what runs with it ended, too: {names}"),
        Some(_) => format!("  what runs with it is started again, too: {names}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cause_of_a_death_comes_first_and_what_follows_on_a_line_of_its_own() {
        let told = died("detect", "failed: learnt at another rate: learn anew", None);
        assert_eq!(
            told,
            "error: stage `detect` failed: learnt at another rate: learn anew\n  it is not started again, and the run ends"
        );
        let told = died("detect", "was killed by signal 9", None);
        assert_eq!(
            told,
            "error: stage `detect` was killed by signal 9 and is not started again"
        );
    }
}
