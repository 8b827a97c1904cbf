//! A worker: one process of this host and the stages that run in it, over all incarnations.

use tauscope_bus::Seat;
use tokio::time::Instant;

use super::patience::{Overdue, Patience};
use super::process::Process;

/// A worker process of this host.
#[derive(Debug)]
pub struct Worker {
    /// Its name.
    pub name: String,
    /// Its stages, as indices into those of this host.
    pub stages: Vec<usize>,
    /// Whether it is an external program, which has one seat and ends by itself.
    pub outside: bool,
    /// Number of the current incarnation.
    pub life: u64,
    process: Option<Process>,
    /// Wait for its exit, once it has nothing left to do.
    closing: Option<Patience>,
}

impl Worker {
    /// Creates a worker that has not been started.
    pub fn new(name: &str, outside: bool) -> Self {
        Self {
            name: name.to_owned(),
            stages: Vec::new(),
            outside,
            life: 0,
            process: None,
            closing: None,
        }
    }

    /// Returns the process, if it runs.
    pub fn process(&self) -> Option<&Process> {
        self.process.as_ref()
    }

    /// Sets its running process.
    pub fn started(&mut self, process: Process) {
        self.process = Some(process);
        self.closing = None;
    }

    /// Notes that its process has exited.
    pub fn exited(&mut self) {
        self.process = None;
        self.life += 1;
    }

    /// Returns the line for its standard input that starts the stages with these seats, which are one group.
    pub fn line(&self, seats: &[&Seat]) -> Result<Vec<u8>, serde_json::Error> {
        match seats {
            [seat] if self.outside => serde_json::to_vec(seat),
            seats => serde_json::to_vec(seats),
        }
    }

    /// Asks the stage of that name to end, with all stages of its group.
    pub fn stop(&self, stage: &str) {
        let Some(process) = &self.process else { return };
        process.tell(if self.outside {
            b"stop".to_vec()
        } else {
            format!("stop {stage}").into_bytes()
        });
    }

    /// Closes its standard input, because it has nothing left to do: it exits.
    pub fn close(&mut self, now: Instant) {
        if let Some(process) = &mut self.process
            && self.closing.is_none()
        {
            process.close();
            self.closing = Some(Patience::new(false, now));
        }
    }

    /// Kills it if it has nothing left to do and does not exit.
    pub fn kill_if_it_stays(&mut self, now: Instant) {
        let overdue = self.closing.as_mut().and_then(|it| it.overdue(now));
        if overdue == Some(Overdue::Kill) {
            self.kill();
        }
    }

    /// Kills it.
    pub fn kill(&self) {
        if let Some(process) = &self.process {
            process.kill();
        }
    }
}
