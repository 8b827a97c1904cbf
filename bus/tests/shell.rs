//! Shells around a source, a stage and a sink, linked in process.

// Helpers outside a test function.
#![allow(clippy::unwrap_used)]

use std::sync::{Arc, Mutex};
use std::time::Duration;

use tauscope_bus::seat::{AnyReceiver, AnySender};
use tauscope_bus::shell::{self, Context, Ends, Input, Node, Outcome, Report};
use tauscope_bus::{
    Audience, Detection, Emit, Health, InProcess, JointState, Keep, Progress, Sample, SampleRef,
    Sender, Sink, Source, Stage, StageError, Transport, TwinState,
};

const MS: i64 = 1_000_000;

/// Emits samples at 100 Hz of stream time, without an end unless it has a length.
struct Counter {
    next: i64,
    length: i64,
}

impl Source<JointState> for Counter {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        if self.next == self.length {
            return Ok(Progress::End);
        }
        out.emit(&mut |sample| sample.header.stamp_ns = self.next * 10 * MS)?;
        self.next += 1;
        Ok(Progress::More)
    }

    fn dropped(&self) -> u64 {
        3
    }
}

/// Emits the stamp of the previous sample.
#[derive(Default)]
struct Delay {
    held: Option<i64>,
    fail_at: Option<i64>,
}

impl Stage<JointState, TwinState> for Delay {
    fn accept(
        &mut self,
        sample: &JointState,
        out: &mut dyn Emit<TwinState>,
    ) -> Result<(), StageError> {
        if self.fail_at == Some(sample.header.stamp_ns) {
            return Err(StageError::failed("it is broken"));
        }
        if let Some(stamp) = self.held.replace(sample.header.stamp_ns) {
            out.emit(&mut |twin| twin.header.stamp_ns = stamp)?;
        }
        Ok(())
    }

    fn finish(&mut self, out: &mut dyn Emit<TwinState>) -> Result<(), StageError> {
        if let Some(stamp) = self.held.take() {
            out.emit(&mut |twin| twin.header.stamp_ns = stamp)?;
        }
        Ok(())
    }
}

#[derive(Default)]
struct Seen {
    stamps: Vec<(String, i64)>,
    health: Vec<Health>,
    finished: bool,
    idle: usize,
}

struct Keeper(Arc<Mutex<Seen>>);

impl Sink for Keeper {
    fn accept(&mut self, from: &str, sample: SampleRef<'_>) -> Result<(), StageError> {
        let mut seen = self.0.lock().unwrap();
        match sample {
            SampleRef::Health(health) => seen.health.push(*health),
            other => seen.stamps.push((from.to_owned(), other.header().stamp_ns)),
        }
        Ok(())
    }

    fn idle(&mut self) -> Result<(), StageError> {
        self.0.lock().unwrap().idle += 1;
        Ok(())
    }

    fn finish(&mut self) -> Result<(), StageError> {
        self.0.lock().unwrap().finished = true;
        Ok(())
    }
}

/// Runs a group of one node.
fn run(context: &Context, node: Node<'_>, ends: Ends) -> Report {
    let mut reports = shell::run(context, vec![(node, ends)]).unwrap();
    reports.pop().unwrap()
}

/// An input that receives from a link.
fn input<T: Sample>(links: &InProcess, from: &str, stream: &str) -> Input {
    let receiver = links.receiver::<T>(stream, Keep::All, 16).unwrap();
    Input::Link {
        from: from.to_owned(),
        open: Box::new(move || Ok(Box::new(receiver) as Box<dyn AnyReceiver>)),
    }
}

struct Chain {
    source: Report,
    stage: Report,
    sink: Report,
    seen: Arc<Mutex<Seen>>,
}

/// A source, a stage, and a sink that receives both streams and the stage's health.
fn run_chain(length: i64, stop_after: Option<Duration>) -> Chain {
    let links = InProcess::new();
    let both = Audience::of(Keep::All, 2);
    let one = Audience::of(Keep::All, 1);
    let states = links.sender::<JointState>("c/count", both).unwrap();
    let twins = links.sender::<TwinState>("c/delay", one).unwrap();
    let health: Box<dyn Sender<Health>> = links.sender("c/delay/health", one).unwrap();
    let states_in = input::<JointState>(&links, "count", "c/count");
    let inputs = vec![
        input::<JointState>(&links, "count", "c/count"),
        input::<TwinState>(&links, "delay", "c/delay"),
        input::<Health>(&links, "delay", "c/delay/health"),
    ];
    let seen = Arc::new(Mutex::new(Seen::default()));
    let source_context = Context::new("count");
    let (source, stage, sink) = std::thread::scope(|scope| {
        let source = scope.spawn(|| {
            let ends = Ends {
                output: Some(AnySender::new(states)),
                ..Ends::new("count", vec![])
            };
            let source = Node::source(Box::new(Counter { next: 0, length }));
            run(&source_context, source, ends)
        });
        let stage = scope.spawn(move || {
            let ends = Ends {
                output: Some(AnySender::new(twins)),
                health: Some(health),
                ..Ends::new("delay", vec![states_in])
            };
            let stage = Node::stage(Box::new(Delay::default()));
            run(&Context::new("delay"), stage, ends)
        });
        let sink = scope.spawn(|| {
            let sink = Node::sink(Box::new(Keeper(Arc::clone(&seen))));
            run(&Context::new("keep"), sink, Ends::new("keep", inputs))
        });
        if let Some(time) = stop_after {
            std::thread::sleep(time);
            source_context.stop.stop();
        }
        (
            source.join().unwrap(),
            stage.join().unwrap(),
            sink.join().unwrap(),
        )
    });
    Chain {
        source,
        stage,
        sink,
        seen,
    }
}

#[test]
fn a_stream_runs_through_to_its_end() {
    let chain = run_chain(1_000, None);
    let seen = chain.seen.lock().unwrap();
    for from in ["count", "delay"] {
        let stamps = seen
            .stamps
            .iter()
            .filter(|(f, _)| f == from)
            .map(|&(_, s)| s);
        assert!(stamps.eq((0..1_000).map(|n| n * 10 * MS)), "{from}");
    }
    assert!(seen.finished);
    for report in [&chain.source, &chain.stage, &chain.sink] {
        assert_eq!(report.outcome, Some(Outcome::Ended));
        assert_eq!((report.lost, report.undelivered, report.untaken), (0, 0, 0));
    }
    assert_eq!(
        (chain.source.received, chain.source.emitted),
        (1_003, 1_000)
    );
    assert_eq!(chain.source.dropped(), 3);
    assert_eq!((chain.stage.received, chain.stage.emitted), (1_000, 1_000));
    assert!(chain.stage.is_complete() && !chain.source.is_complete());
    assert_eq!(chain.sink.stamp_ns, 9_990 * MS);
}

#[test]
fn health_comes_once_a_second_of_stream_time_and_at_the_end() {
    let chain = run_chain(1_000, None);
    let seen = chain.seen.lock().unwrap();
    let stamps: Vec<_> = seen.health.iter().map(|h| h.header.stamp_ns / MS).collect();
    let seconds = (1..10).map(|s| s * 1_000).chain([9_990]);
    assert!(stamps.iter().copied().eq(seconds), "{stamps:?}");
    assert!(seen.health.iter().all(|h| h.stage.as_str() == "delay"));
    // The first sample of the second is processed; the stage holds one sample back.
    assert_eq!(
        (seen.health[0].received, seen.health[0].emitted),
        (101, 100)
    );
    assert_eq!(
        (seen.health[9].received, seen.health[9].emitted),
        (1_000, 1_000)
    );
}

#[test]
fn a_source_that_is_stopped_ends_all_in_order() {
    let chain = run_chain(i64::MAX, Some(Duration::from_millis(50)));
    assert_eq!(chain.source.outcome, Some(Outcome::Stopped));
    assert_eq!(chain.stage.outcome, Some(Outcome::Ended));
    assert_eq!(chain.sink.outcome, Some(Outcome::Ended));
    assert!(chain.source.emitted > 0);
    assert_eq!(chain.stage.emitted, chain.source.emitted);
    assert_eq!(chain.sink.lost, 0);
}

#[test]
fn a_stage_that_fails_says_why_and_ends_no_stream() {
    let links = InProcess::new();
    let one = Audience::of(Keep::All, 1);
    let mut states: Box<dyn Sender<JointState>> = links.sender("c/count", one).unwrap();
    let states_in = input::<JointState>(&links, "count", "c/count");
    let twins = links.sender::<TwinState>("c/delay", one).unwrap();
    let mut output = links
        .receiver::<TwinState>("c/delay", Keep::All, 16)
        .unwrap();
    for stamp in 0..5 {
        states
            .send_with(&mut |sample| sample.header.stamp_ns = stamp)
            .unwrap();
    }
    let stage = Delay {
        fail_at: Some(3),
        ..Delay::default()
    };
    let context = Context::new("delay");
    let ends = Ends {
        output: Some(AnySender::new(twins)),
        ..Ends::new("delay", vec![states_in])
    };
    let report = run(&context, Node::stage(Box::new(stage)), ends);
    assert_eq!(
        report.outcome,
        Some(Outcome::Failed("it is broken".to_owned()))
    );
    assert_eq!((report.received, report.emitted), (4, 2));
    assert_eq!(context.board.read(), [report]);
    let mut heard = 0;
    let soon = Duration::from_millis(10);
    while output.receive(soon, &mut |_| heard += 1).unwrap() == tauscope_bus::Received::Sample {}
    assert_eq!(heard, 2);
}

#[test]
fn a_sink_that_is_stopped_deals_with_what_has_arrived_and_flushes_while_idle() {
    let links = InProcess::new();
    let mut detections: Box<dyn Sender<Detection>> = links
        .sender("c/detect", Audience::of(Keep::All, 1))
        .unwrap();
    let inputs = vec![input::<Detection>(&links, "detect", "c/detect")];
    let seen = Arc::new(Mutex::new(Seen::default()));
    let context = Context::new("keep");
    let report = std::thread::scope(|scope| {
        let sink = scope.spawn(|| {
            let sink = Node::sink(Box::new(Keeper(Arc::clone(&seen))));
            run(&context, sink, Ends::new("keep", inputs))
        });
        while seen.lock().unwrap().idle == 0 {
            std::thread::sleep(Duration::from_millis(1));
        }
        for _ in 0..10 {
            detections.send_with(&mut |_| {}).unwrap();
        }
        context.stop.stop();
        sink.join().unwrap()
    });
    assert_eq!(report.outcome, Some(Outcome::Stopped));
    assert_eq!(report.received, 10);
    assert!(seen.lock().unwrap().finished);
}
