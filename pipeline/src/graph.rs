//! A pipeline in one process and one thread.
//!
//! After each step of a source the stages below take what there is for them, a sample each in the order of the
//! pipeline (each stage after those it listens to) until nothing is left, then the sinks, before the next step. So
//! stages that listen to one stream go through it side by side, as those that share what they derive must, and the
//! order of everything that is written is a function of the pipeline and the recording alone.

mod sink;

use std::time::Duration;

use serde::Serialize;
use tauscope_bus::shell::{HealthClock, Report};
use tauscope_bus::{
    Audience, Emit, Header, InProcess, Keep, LinkError, Progress, Received, Receiver, Sample,
    Sender, Sink, Source, Stage, StageError, Transport,
};

pub use self::sink::SinkInput;
use self::sink::SinkNode;

/// Samples a stage may leave unread. A source gives out at most a few in a step, and they are all
/// taken before its next one.
/// Resolution: memory.
const DEPTH: usize = 1024;

/// Where a stage's output goes, and the header of what went out last.
struct Outlet<T: Sample> {
    link: Box<dyn Sender<T>>,
    newest: Option<Header>,
}

impl<T: Sample> Emit<T> for Outlet<T> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        let newest = &mut self.newest;
        self.link.send_with(&mut |slot| {
            write(slot);
            *newest = Some(*slot.header());
        })
    }
}

/// A stage's health reports, by the stream's own clock.
type Health = HealthClock<Box<dyn Sender<tauscope_bus::Health>>>;

/// What a stage has counted.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StageCounts {
    /// The stage.
    pub stage: String,
    /// Samples that came in.
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
    health: Health,
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
            .is_some_and(|newest| self.health.note(&newest))
        {
            self.health.send(&self.counts().report())?;
        }
        if progress == Progress::End {
            self.ended = true;
            self.out.link.end()?;
            self.health.end(&self.counts().report())?;
        }
        Ok(true)
    }

    fn is_over(&self) -> bool {
        self.ended
    }

    fn counts(&self) -> StageCounts {
        StageCounts {
            stage: self.name.clone(),
            received: 0,
            emitted: self.out.link.counts().sent,
            dropped: self.source.dropped(),
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
    input: Box<dyn Receiver<I>>,
    out: Outlet<O>,
    health: Health,
    ended: bool,
}

impl<I: Sample, O: Sample> Node for StageNode<I, O> {
    fn turn(&mut self) -> Result<bool, StageError> {
        if self.ended {
            return Ok(false);
        }
        let (mut result, mut due) = (Ok(()), false);
        let (stage, out, health) = (&mut self.stage, &mut self.out, &mut self.health);
        let received = self.input.receive(Duration::ZERO, &mut |sample| {
            due = health.note(sample.header());
            result = stage.accept(sample, out);
        })?;
        result?;
        match received {
            Received::Sample if due => self.health.send(&self.counts().report())?,
            Received::Sample => {}
            Received::Nothing => return Ok(false),
            Received::End => {
                self.stage.finish(&mut self.out)?;
                self.out.link.end()?;
                self.health.end(&self.counts().report())?;
                self.ended = true;
            }
        }
        Ok(true)
    }

    fn is_over(&self) -> bool {
        self.ended
    }

    fn counts(&self) -> StageCounts {
        let input = self.input.counts();
        StageCounts {
            stage: self.name.clone(),
            received: input.received,
            emitted: self.out.link.counts().sent,
            dropped: input.lost + self.stage.dropped(),
        }
    }
}

/// A stream of a [`Graph`], by the stage that makes it.
#[derive(Debug, Clone)]
pub struct Stream {
    stage: String,
}

impl Stream {
    fn key(&self) -> &str {
        &self.stage
    }

    fn health_key(&self) -> String {
        format!("{}/health", self.stage)
    }
}

/// Stages in one thread, in the order in which they were added.
#[derive(Default)]
pub struct Graph<'a> {
    links: InProcess,
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
    ///
    /// # Errors
    /// If its link cannot be opened.
    pub fn source<T: Sample>(
        &mut self,
        name: &str,
        source: Box<dyn Source<T>>,
    ) -> Result<Stream, LinkError> {
        let (stream, out, health) = self.outlets(name)?;
        let name = name.to_owned();
        let node = SourceNode {
            name,
            source,
            out,
            health,
            ended: false,
        };
        self.nodes.push((Place::Source, Box::new(node)));
        Ok(stream)
    }

    /// Adds a stage that listens to `input`.
    ///
    /// # Errors
    /// If a link cannot be opened, or `input` carries another type.
    pub fn stage<I: Sample, O: Sample>(
        &mut self,
        name: &str,
        stage: Box<dyn Stage<I, O>>,
        input: &Stream,
    ) -> Result<Stream, LinkError> {
        let input = self.links.receiver(input.key(), Keep::All, DEPTH)?;
        let (stream, out, health) = self.outlets(name)?;
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
    /// If the link cannot be opened, or the stream carries another type.
    pub fn listen<T: Sample>(&mut self, stream: &Stream) -> Result<SinkInput, LinkError> {
        self.input::<T>(stream, stream.key())
    }

    /// A receiving end of the health reports of the stage that makes `stream`, for a sink.
    ///
    /// # Errors
    /// If the link cannot be opened.
    pub fn listen_to_health(&mut self, stream: &Stream) -> Result<SinkInput, LinkError> {
        self.input::<tauscope_bus::Health>(stream, &stream.health_key())
    }

    fn input<T: Sample>(&mut self, stream: &Stream, key: &str) -> Result<SinkInput, LinkError> {
        let receiver: Box<dyn Receiver<T>> = self.links.receiver(key, Keep::All, DEPTH)?;
        Ok(SinkInput::new(&stream.stage, receiver))
    }

    /// Adds a sink.
    pub fn sink(&mut self, name: &str, sink: Box<dyn Sink + 'a>, inputs: Vec<SinkInput>) {
        let node = SinkNode::new(name, sink, inputs);
        self.nodes.push((Place::Sink, Box::new(node)));
    }

    fn outlets<T: Sample>(&mut self, name: &str) -> Result<(Stream, Outlet<T>, Health), LinkError> {
        let stream = Stream {
            stage: name.to_owned(),
        };
        let link = self.links.sender(stream.key(), Audience::default())?;
        let health = self
            .links
            .sender(&stream.health_key(), Audience::default())?;
        Ok((
            stream,
            Outlet { link, newest: None },
            HealthClock::new(health, name, 0),
        ))
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
