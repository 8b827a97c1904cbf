//! A pipeline in one process and one thread.
//!
//! Each step of a source is processed completely before the next one. The stages take one sample each, in the order
//! of the pipeline (each stage after its inputs), until none is left; then the sinks run. Stages that listen to the
//! same stream therefore advance together, as those that share derived values must. The order of all outputs depends
//! on the pipeline and the recording only.
//!
//! No sample is copied: the following stages read it in the buffer of its producer (`lane.rs`). A transport of the
//! bus would add a lock and a wake-up per sample, which one thread does not need.

mod lane;
mod sink;

use std::any::Any;
use std::rc::Rc;

use serde::Serialize;
use tauscope_bus::shell::{HealthClock, Report};
use tauscope_bus::{
    Emit, Header, Health, LinkError, Progress, Received, Sample, SampleKind, Sink, Source, Stage,
    StageError,
};

use self::lane::{Lane, Reader, Tidy};
pub use self::sink::SinkInput;
use self::sink::SinkNode;

/// Output of a stage, with the header of the last sample.
struct Outlet<T> {
    lane: Rc<Lane<T>>,
    newest: Option<Header>,
}

impl<T: Sample> Emit<T> for Outlet<T> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        self.newest = Some(self.lane.write(write));
        Ok(())
    }
}

/// Health reports of a stage, timed by the stream's clock.
struct HealthOutlet {
    clock: HealthClock,
    lane: Rc<Lane<Health>>,
}

impl HealthOutlet {
    fn send(&mut self, report: &Report) {
        let clock = &self.clock;
        self.lane.write(&mut |health| clock.fill(report, health));
    }

    fn end(&mut self, report: &Report) {
        self.send(report);
        self.lane.end();
    }
}

/// Sample counters of a stage.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StageCounts {
    /// The stage.
    pub stage: String,
    /// Number of samples received; for a source, read.
    pub received: u64,
    /// Number of samples emitted.
    pub emitted: u64,
    /// Number of samples that were refused or did not arrive.
    pub dropped: u64,
}

impl StageCounts {
    fn report(&self) -> Report {
        Report {
            stage: self.stage.clone(),
            received: self.received,
            emitted: self.emitted,
            refused: self.dropped,
            ..Report::default()
        }
    }
}

/// A stage with its links, independent of its sample types.
trait Node {
    /// Performs a source's step, or processes a stage's next sample or all samples of a sink; false if there was
    /// none.
    fn turn(&mut self) -> Result<bool, StageError>;
    /// Whether it will emit nothing more.
    fn is_over(&self) -> bool;
    fn counts(&self) -> StageCounts;
    fn fraction_done(&self) -> Option<f64> {
        None
    }
}

struct SourceNode<T: Sample> {
    name: String,
    source: Box<dyn Source<T>>,
    out: Outlet<T>,
    health: HealthOutlet,
    ended: bool,
}

impl<T: Sample> Node for SourceNode<T> {
    fn turn(&mut self) -> Result<bool, StageError> {
        if self.ended {
            return Ok(false);
        }
        let progress = self.source.step(&mut self.out)?;
        if self
            .out
            .newest
            .take()
            .is_some_and(|newest| self.health.clock.note(&newest))
        {
            self.health.send(&self.counts().report());
        }
        if progress == Progress::End {
            self.ended = true;
            self.out.lane.end();
            self.health.end(&self.counts().report());
        }
        Ok(true)
    }

    fn is_over(&self) -> bool {
        self.ended
    }

    fn counts(&self) -> StageCounts {
        let (emitted, dropped) = (self.out.lane.sent(), self.source.dropped());
        StageCounts {
            stage: self.name.clone(),
            received: emitted + dropped,
            emitted,
            dropped,
        }
    }

    fn fraction_done(&self) -> Option<f64> {
        if self.ended {
            Some(1.0)
        } else {
            self.source.fraction_done()
        }
    }
}

struct StageNode<I: Sample, O: Sample> {
    name: String,
    stage: Box<dyn Stage<I, O>>,
    input: Reader<I>,
    out: Outlet<O>,
    health: HealthOutlet,
    ended: bool,
}

impl<I: Sample, O: Sample> Node for StageNode<I, O> {
    fn turn(&mut self) -> Result<bool, StageError> {
        if self.ended {
            return Ok(false);
        }
        let (stage, out, clock) = (&mut self.stage, &mut self.out, &mut self.health.clock);
        let (received, accepted) = self.input.receive(|sample| {
            let due = clock.note(sample.header());
            stage.accept(sample, out).map(|()| due)
        });
        if accepted.transpose()?.unwrap_or(false) {
            self.health.send(&self.counts().report());
        }
        match received {
            Received::Sample => {}
            Received::Nothing => return Ok(false),
            Received::End => {
                self.stage.finish(&mut self.out)?;
                self.out.lane.end();
                self.health.end(&self.counts().report());
                self.ended = true;
            }
        }
        Ok(true)
    }

    fn is_over(&self) -> bool {
        self.ended
    }

    fn counts(&self) -> StageCounts {
        StageCounts {
            stage: self.name.clone(),
            received: self.input.received(),
            emitted: self.out.lane.sent(),
            dropped: self.stage.dropped(),
        }
    }
}

/// A stream of a [`Graph`].
#[derive(Debug, Clone)]
pub struct Stream {
    stage: String,
    kind: SampleKind,
    /// A `Lane` of the type that `kind` names.
    lane: Rc<dyn Any>,
    health: Rc<Lane<Health>>,
}

impl Stream {
    fn reader<T: Sample>(&self) -> Result<Reader<T>, LinkError> {
        let lane = Rc::clone(&self.lane).downcast::<Lane<T>>();
        Ok(lane.map_err(|_| self.mismatch(T::KIND))?.reader())
    }

    fn mismatch(&self, expected: SampleKind) -> LinkError {
        LinkError::TypeMismatch {
            stream: self.stage.clone(),
            expected: expected.type_name().to_owned(),
            found: self.kind.type_name().to_owned(),
        }
    }
}

/// Stages in one thread, in the order in which they were added.
#[derive(Default)]
pub struct Graph<'a> {
    lanes: Vec<Rc<dyn Tidy>>,
    nodes: Vec<(Place, Box<dyn Node + 'a>)>,
}

/// Position of a node in the graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    Source,
    Stage,
    Sink,
}

impl<'a> Graph<'a> {
    /// Number of sources, stages and sinks.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether the graph has no nodes.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Adds a source.
    pub fn source<T: Sample>(&mut self, name: &str, source: Box<dyn Source<T>>) -> Stream {
        let (stream, out, health) = self.outlets(name);
        let name = name.to_owned();
        let node = SourceNode {
            name,
            source,
            out,
            health,
            ended: false,
        };
        self.nodes.push((Place::Source, Box::new(node)));
        stream
    }

    /// Adds a stage that listens to `input`.
    ///
    /// # Errors
    /// If `input` carries another type.
    pub fn stage<I: Sample, O: Sample>(
        &mut self,
        name: &str,
        stage: Box<dyn Stage<I, O>>,
        input: &Stream,
    ) -> Result<Stream, LinkError> {
        let input = input.reader()?;
        let (stream, out, health) = self.outlets(name);
        let name = name.to_owned();
        let node = StageNode {
            name,
            stage,
            input,
            out,
            health,
            ended: false,
        };
        self.nodes.push((Place::Stage, Box::new(node)));
        Ok(stream)
    }

    /// Returns an input of a sink for `stream`.
    ///
    /// # Errors
    /// If the stream carries another type.
    pub fn listen<T: Sample>(&self, stream: &Stream) -> Result<SinkInput, LinkError> {
        Ok(SinkInput::new::<T>(&stream.stage, stream.reader()?))
    }

    /// Returns an input of a sink for the health reports of the stage that emits `stream`.
    pub fn listen_to_health(&self, stream: &Stream) -> SinkInput {
        SinkInput::new(&stream.stage, stream.health.reader())
    }

    /// Adds a sink.
    pub fn sink(&mut self, name: &str, sink: Box<dyn Sink + 'a>, inputs: Vec<SinkInput>) {
        let node = SinkNode::new(name, sink, inputs);
        self.nodes.push((Place::Sink, Box::new(node)));
    }

    fn outlets<T: Sample>(&mut self, name: &str) -> (Stream, Outlet<T>, HealthOutlet) {
        let (lane, health) = (Lane::<T>::of(name), Lane::of(name));
        let tidied: [Rc<dyn Tidy>; 2] = [lane.clone(), health.clone()];
        self.lanes.extend(tidied);
        let stream = Stream {
            stage: name.to_owned(),
            kind: T::KIND,
            lane: lane.clone(),
            health: Rc::clone(&health),
        };
        let clock = HealthClock::new(name, 0);
        let outlet = Outlet { lane, newest: None };
        let health = HealthOutlet {
            clock,
            lane: health,
        };
        (stream, outlet, health)
    }

    /// Runs until every source has ended and all samples are processed. `progress` receives the completed fraction of
    /// the sources of known length, 0 to 1. If it returns `false`, the run is cancelled, no output is completed, and
    /// the result is `None`.
    ///
    /// # Errors
    /// The first error of a stage.
    pub fn run(
        &mut self,
        progress: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Option<Vec<StageCounts>>, StageError> {
        loop {
            self.turn(Place::Source)?;
            while self.turn(Place::Stage)? {}
            self.turn(Place::Sink)?;
            self.lanes.iter().for_each(|lane| lane.tidy());
            let nodes = || self.nodes.iter().map(|(_, node)| node);
            let done = nodes().filter_map(|node| node.fraction_done());
            let goes_on = progress(done.fold(1.0, f64::min));
            if nodes().all(|node| node.is_over()) {
                return Ok(Some(nodes().map(|node| node.counts()).collect()));
            }
            if !goes_on {
                return Ok(None);
            }
        }
    }

    /// Runs each node at this position once; false if none had anything to process.
    fn turn(&mut self, at: Place) -> Result<bool, StageError> {
        let mut any = false;
        for (_, node) in self.nodes.iter_mut().filter(|(place, _)| *place == at) {
            any |= node.turn()?;
        }
        Ok(any)
    }
}
