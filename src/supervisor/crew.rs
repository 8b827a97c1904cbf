//! One process of this host and the stages that run in it, through all its lives.

use tauscope_bus::Seat;
use tokio::time::Instant;

use super::patience::{Overdue, Patience};
use super::process::Process;

/// A process of this host.
#[derive(Debug)]
pub struct Crew {
    /// Its name.
    pub name: String,
    /// Its stages, by their place among those of this host.
    pub stages: Vec<usize>,
    /// Whether it is a program that is not ours, which knows one seat and ends by itself.
    pub outside: bool,
    /// Which life it is in.
    pub life: u64,
    process: Option<Process>,
    /// Since nothing is left to do for it.
    closing: Option<Patience>,
}

impl Crew {
    /// A process that is to be started.
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

    /// The process, while there is one.
    pub fn process(&self) -> Option<&Process> {
        self.process.as_ref()
    }

    /// It has been started.
    pub fn started(&mut self, process: Process) {
        self.process = Some(process);
        self.closing = None;
    }

    /// It has ended.
    pub fn exited(&mut self) {
        self.process = None;
        self.life += 1;
    }

    /// What tells it to run the stages with these seats, which are one tree.
    pub fn line(&self, seats: &[&Seat]) -> Result<Vec<u8>, serde_json::Error> {
        match seats {
            [seat] if self.outside => serde_json::to_vec(seat),
            seats => serde_json::to_vec(seats),
        }
    }

    /// Asks the stage of that name to end, and all that run with it in one tree.
    pub fn stop(&self, stage: &str) {
        let Some(process) = &self.process else { return };
        process.tell(if self.outside {
            b"stop".to_vec()
        } else {
            format!("stop {stage}").into_bytes()
        });
    }

    /// Nothing is left to do for it: it ends.
    pub fn close(&mut self, now: Instant) {
        if let Some(process) = &mut self.process
            && self.closing.is_none()
        {
            process.close();
            self.closing = Some(Patience::new(false, now));
        }
    }

    /// Ends it at once, if it has nothing left to do and stays.
    pub fn kill_if_it_stays(&mut self, now: Instant) {
        let overdue = self.closing.as_mut().and_then(|it| it.overdue(now));
        if overdue == Some(Overdue::Kill) {
            self.kill();
        }
    }

    /// Ends it at once.
    pub fn kill(&self) {
        if let Some(process) = &self.process {
            process.kill();
        }
    }
}
