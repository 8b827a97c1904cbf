//! A stage in a process of its own, which is killed, stopped and started again.
//!
//! This test binary is the process as well: started with the name of [`a_stage_process`].

// Helpers outside a test function.
#![allow(clippy::unwrap_used)]

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use tauscope_bus::link::{Domain, PATIENCE};
use tauscope_bus::seat::{Input, Output, OutputLink, TransportKind};
use tauscope_bus::shell::{self, Line, Outcome, Report};
use tauscope_bus::{
    Audience, Emit, Health, JointState, Keep, Position, Received, Receiver, SampleKind, Seat,
    Sender, SharedMemory, Stage, StageError, Transport, TwinState, Wake,
};

const LONG: Duration = Duration::from_secs(20);
const DEPTH: usize = 64;

/// Emits a sample with the same stamp for each input.
struct Echo;

impl Stage<JointState, TwinState> for Echo {
    fn accept(
        &mut self,
        sample: &JointState,
        out: &mut dyn Emit<TwinState>,
    ) -> Result<(), StageError> {
        out.emit(&mut |twin| twin.header.stamp_ns = sample.header.stamp_ns)?;
        Ok(())
    }
}

#[test]
#[ignore = "the process of a stage, which the other tests start"]
fn a_stage_process() {
    let code = shell::outside(|seat: &Seat| match seat.config.as_str() {
        Some(reason) => Err(std::io::Error::other(reason.to_owned())),
        None => Ok(Echo),
    });
    // Exits without returning to the test harness, which has an exit code of its own.
    std::process::exit(i32::from(code != std::process::ExitCode::SUCCESS));
}

/// The links to both sides of the stage, and its supervisor.
struct Around {
    domain: Domain,
    links: Option<SharedMemory>,
}

impl Around {
    fn new(patience: Duration) -> Self {
        let domain = Domain::unique();
        let links = SharedMemory::open(&domain).unwrap().with_patience(patience);
        Self {
            links: Some(links),
            domain,
        }
    }

    fn links(&self) -> &SharedMemory {
        self.links.as_ref().unwrap()
    }

    fn seat(&self) -> Seat {
        let output = |stream: &str, kind| Output {
            stream: stream.to_owned(),
            kind,
            former: 0,
            links: vec![OutputLink {
                transport: TransportKind::Iceoryx2,
                audience: Audience::of(Keep::All, 1),
                spill: None,
            }],
        };
        let mut seat = Seat::new("echo", self.domain.clone());
        seat.inputs = vec![Input {
            from: "source".to_owned(),
            stream: "c/source".to_owned(),
            kind: SampleKind::JointState,
            transport: TransportKind::Iceoryx2,
            keep: Keep::All,
            depth: DEPTH,
            wake: Wake::Event,
            resume: None,
        }];
        seat.output = Some(output("c/echo", SampleKind::TwinState));
        seat.health = Some(output("c/echo/health", SampleKind::Health));
        seat
    }

    fn sender(&self) -> Box<dyn Sender<JointState>> {
        let audience = Audience::of(Keep::All, 1);
        self.links().sender("c/source", audience).unwrap()
    }

    fn receiver<T: tauscope_bus::Sample>(&self, stream: &str) -> Box<dyn Receiver<T>> {
        self.links().receiver(stream, Keep::All, DEPTH).unwrap()
    }
}

impl Drop for Around {
    fn drop(&mut self) {
        self.links = None;
        self.domain.remove().unwrap();
    }
}

/// The process of a stage, as its supervisor sees it.
struct Process {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Process {
    fn start(first_line: &str) -> Self {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "a_stage_process", "--ignored", "--nocapture"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut input = child.stdin.take().unwrap();
        writeln!(input, "{first_line}").unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        Self {
            child,
            input: Some(input),
            output,
        }
    }

    fn seated(seat: &Seat) -> Self {
        Self::start(&serde_json::to_string(seat).unwrap())
    }

    /// The next line of the protocol; lines of the test harness are skipped.
    fn line(&mut self) -> Line {
        loop {
            let mut text = String::new();
            assert!(self.output.read_line(&mut text).unwrap() > 0, "it is gone");
            if let Ok(line) = serde_json::from_str(&text) {
                return line;
            }
        }
    }

    fn report(&mut self, wanted: impl Fn(&Report) -> bool) -> Report {
        loop {
            match self.line() {
                Line::Report(report) if wanted(&report) => return report,
                Line::Done(report) => panic!("{report:?}"),
                _ => {}
            }
        }
    }

    fn done(mut self) -> (Report, ExitStatus) {
        let report = loop {
            if let Line::Done(report) = self.line() {
                break report;
            }
        };
        (report, self.child.wait().unwrap())
    }

    fn stop(&mut self) {
        self.input = None;
    }
}

/// Polls both sides of the stage until all are connected.
fn meet(process: &mut Process, sender: &mut dyn Sender<JointState>, sinks: &mut Sinks) {
    std::thread::scope(|scope| {
        let ready = scope.spawn(|| process.line());
        while !ready.is_finished() {
            sinks.look();
        }
        assert_eq!(
            ready.join().unwrap(),
            Line::Ready {
                stage: "echo".to_owned(),
                missing: 0
            }
        );
    });
    assert_eq!(sender.wait_for_receivers(LONG).unwrap(), 0);
}

struct Sinks {
    twin: Box<dyn Receiver<TwinState>>,
    health: Box<dyn Receiver<Health>>,
}

impl Sinks {
    fn new(around: &Around) -> Self {
        Self {
            twin: around.receiver("c/echo"),
            health: around.receiver("c/echo/health"),
        }
    }

    fn look(&mut self) {
        let soon = Duration::from_millis(2);
        self.twin.receive(soon, &mut |_| {}).unwrap();
        self.health.receive(Duration::ZERO, &mut |_| {}).unwrap();
    }

    fn take(&mut self, count: usize) -> Vec<i64> {
        let mut stamps = Vec::new();
        let deadline = Instant::now() + LONG;
        while stamps.len() < count && Instant::now() < deadline {
            let read = &mut |twin: &TwinState| stamps.push(twin.header.stamp_ns);
            self.twin.receive(Duration::from_millis(50), read).unwrap();
        }
        stamps
    }

    /// Receives both streams to their end.
    fn take_to_end(&mut self) {
        let deadline = Instant::now() + LONG;
        for receive in [
            &mut || self.twin.receive(Duration::from_millis(50), &mut |_| {}),
            &mut || self.health.receive(Duration::from_millis(50), &mut |_| {}),
        ] as [&mut dyn FnMut() -> _; 2]
        {
            while receive().unwrap() != Received::End {
                assert!(Instant::now() < deadline, "no end");
            }
        }
    }
}

fn send(sender: &mut dyn Sender<JointState>, stamps: std::ops::Range<i64>) {
    for stamp in stamps {
        sender
            .send_with(&mut |sample| sample.header.stamp_ns = stamp)
            .unwrap();
    }
}

#[test]
fn a_killed_stage_is_started_again_and_its_loss_is_counted() {
    let around = Around::new(PATIENCE);
    let mut sinks = Sinks::new(&around);
    let mut sender = around.sender();
    let mut process = Process::seated(&around.seat());
    meet(&mut process, &mut *sender, &mut sinks);
    send(&mut *sender, 0..10);
    assert_eq!(sinks.take(10), (0..10).collect::<Vec<_>>());
    let position = process
        .report(|report| report.received == 10)
        .inputs
        .remove(0)
        .position
        .unwrap();
    assert_eq!(position.next, 10);

    process.child.kill().unwrap();
    process.child.wait().unwrap();
    assert!(around.links().clean_dead_peers() > 0);
    let begin = Instant::now();
    send(&mut *sender, 10..10 + 2 * DEPTH as i64);
    assert!(begin.elapsed() < PATIENCE, "waits for a crashed receiver");
    assert_eq!(sender.counts().undelivered, 2 * DEPTH as u64);

    let mut seat = around.seat();
    seat.restarts = 1;
    seat.inputs[0].resume = Some(position);
    let mut process = Process::seated(&seat);
    meet(&mut process, &mut *sender, &mut sinks);
    send(&mut *sender, 1_000..1_005);
    assert_eq!(sinks.take(5), (1_000..1_005).collect::<Vec<_>>());
    sender.end().unwrap();
    sinks.take_to_end();
    let (report, status) = process.done();
    assert!(status.success());
    assert_eq!(report.outcome, Some(Outcome::Ended));
    assert_eq!((report.received, report.emitted, report.untaken), (5, 5, 0));
    assert_eq!(report.lost, 2 * DEPTH as u64);
    assert_eq!(sinks.twin.counts().lost, 0, "its own stream begins anew");
    assert_eq!(sender.wait_until_taken(LONG).unwrap(), 0);
}

#[test]
fn without_a_supervisor_the_dead_are_waited_for_no_longer_than_the_patience() {
    let patience = Duration::from_millis(300);
    let around = Around::new(patience);
    let mut sinks = Sinks::new(&around);
    let mut sender = around.sender();
    let mut process = Process::seated(&around.seat());
    meet(&mut process, &mut *sender, &mut sinks);
    process.child.kill().unwrap();
    process.child.wait().unwrap();
    let begin = Instant::now();
    let count = 4 * DEPTH as u64;
    send(&mut *sender, 0..count as i64);
    let elapsed = begin.elapsed();
    assert!(
        elapsed >= patience && elapsed < 20 * patience,
        "{elapsed:?}"
    );
    assert_eq!(
        sender.counts().undelivered,
        count - DEPTH as u64,
        "its buffer took the rest"
    );
}

#[test]
fn a_stage_stops_with_its_supervisor_and_ends_its_stream() {
    let around = Around::new(PATIENCE);
    let mut sinks = Sinks::new(&around);
    let mut sender = around.sender();
    let mut process = Process::seated(&around.seat());
    meet(&mut process, &mut *sender, &mut sinks);
    send(&mut *sender, 0..10);
    process.stop();
    assert_eq!(sinks.take(10).len(), 10);
    sinks.take_to_end();
    let (report, status) = process.done();
    assert_eq!(report.outcome, Some(Outcome::Stopped));
    assert_eq!((report.received, report.emitted), (10, 10));
    assert!(status.success());
}

#[test]
fn a_stage_that_cannot_be_made_says_why() {
    let around = Around::new(PATIENCE);
    let mut seat = around.seat();
    seat.config = "no such model".into();
    let (report, status) = Process::seated(&seat).done();
    assert_eq!(
        report.outcome,
        Some(Outcome::Failed("no such model".to_owned()))
    );
    assert_eq!(status.code(), Some(1));

    let mut seat = around.seat();
    seat.inputs.clear();
    let (report, _) = Process::seated(&seat).done();
    let expected =
        "the seat of `echo` has 0 inputs and an output, expected one input and an output";
    assert_eq!(report.outcome, Some(Outcome::Failed(expected.to_owned())));

    let mut process = Process::start("no seat");
    assert_eq!(process.child.wait().unwrap().code(), Some(1));
}

#[test]
fn a_seat_is_the_same_after_a_journey_as_json() {
    let mut seat = Around::new(PATIENCE).seat();
    seat.inputs[0].resume = Some(Position {
        instance: u64::MAX,
        next: 7,
    });
    let text = serde_json::to_string(&seat).unwrap();
    assert_eq!(serde_json::from_str::<Seat>(&text).unwrap(), seat);
    assert!(!text.contains('\n'), "one line");
}
