//! A pipeline in one process and one thread.
//!
//! After each step of a source the stages below take what there is for them, a sample each in the order of the
//! pipeline (each stage after those it listens to) until nothing is left, then the sinks, before the next step. So
//! stages that listen to one stream go through it side by side, as those that share what they derive must, and the
//! order of everything that is written is a function of the pipeline and the recording alone.
//!
//! No sample is copied on its way: the stages behind read it where its maker wrote it (`lane.rs`). A transport of the
//! bus would do the same with a lock and a wake-up a sample, which one thread needs neither of.

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

/// Where a stage's output goes, and the header of what went out last.
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

/// A stage's health reports, by the stream's own clock.
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

/// What a stage has counted.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StageCounts {
    /// The stage.
    pub stage: String,
    /// Samples that came in; for a source, those that it read.
    pub received: u64,
    /// Samples that went out.
    pub emitted: u64,
    /// Samples that it had to refuse, or that did not reach it.
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

/// A stage with its links, whatever its types are.
trait Node {
    /// A source's step, a stage's next sample, or all there is for a sink; false if there was nothing.
    fn turn(&mut self) -> Result<bool, StageError>;
    /// Nothing more will come out of it.
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

/// Where a node stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    Source,
    Stage,
    Sink,
}

impl<'a> Graph<'a> {
    /// How many sources, stages and sinks there are.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there is none.
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

    /// A receiving end of `stream` for a sink.
    ///
    /// # Errors
    /// If the stream carries another type.
    pub fn listen<T: Sample>(&self, stream: &Stream) -> Result<SinkInput, LinkError> {
        Ok(SinkInput::new::<T>(&stream.stage, stream.reader()?))
    }

    /// A receiving end of the health reports of the stage that makes `stream`, for a sink.
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

    /// Runs until every source has ended and everything has passed through. `progress` is told how
    /// far the sources are, from 0 to 1, where they know, and by returning `false` ends the work: nothing is
    /// completed, and `None` comes back.
    ///
    /// # Errors
    /// The first that a stage gives.
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

    /// A turn for each node that stands there; false if there was nothing for any.
    fn turn(&mut self, at: Place) -> Result<bool, StageError> {
        let mut any = false;
        for (_, node) in self.nodes.iter_mut().filter(|(place, _)| *place == at) {
            any |= node.turn()?;
        }
        Ok(any)
    }
}
