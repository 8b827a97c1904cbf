//! Sinks of a graph, with inputs of any sample type.

use tauscope_bus::{Received, Sample, Sink, StageError};

use super::lane::Reader;
use super::{Node, StageCounts};

/// A reader whose sample type is known at run time only.
trait AnyInput {
    /// Passes all available samples of the stage `from` to `sink`; false at the end of the stream.
    fn take_all(&mut self, from: &str, sink: &mut dyn Sink) -> Result<bool, StageError>;
    fn received(&self) -> u64;
}

impl<T: Sample> AnyInput for Reader<T> {
    fn take_all(&mut self, from: &str, sink: &mut dyn Sink) -> Result<bool, StageError> {
        loop {
            match self.receive(|sample| sink.accept(from, sample.as_ref())) {
                (_, Some(accepted)) => accepted?,
                (received, None) => return Ok(received != Received::End),
            }
        }
    }

    fn received(&self) -> u64 {
        self.received()
    }
}

/// Input stream of a sink.
pub struct SinkInput {
    from: String,
    receiver: Box<dyn AnyInput>,
    open: bool,
}

impl SinkInput {
    /// Creates an input for the stream of the stage `from`.
    pub(super) fn new<T: Sample>(from: &str, receiver: Reader<T>) -> Self {
        Self {
            from: from.to_owned(),
            receiver: Box::new(receiver),
            open: true,
        }
    }
}

/// A sink with its links.
pub(super) struct SinkNode<'a> {
    name: String,
    sink: Box<dyn Sink + 'a>,
    inputs: Vec<SinkInput>,
    ended: bool,
}

impl<'a> SinkNode<'a> {
    pub(super) fn new(name: &str, sink: Box<dyn Sink + 'a>, inputs: Vec<SinkInput>) -> Self {
        Self {
            name: name.to_owned(),
            sink,
            inputs,
            ended: false,
        }
    }
}

impl Node for SinkNode<'_> {
    fn turn(&mut self) -> Result<bool, StageError> {
        if self.ended {
            return Ok(false);
        }
        for input in self.inputs.iter_mut().filter(|input| input.open) {
            input.open = input.receiver.take_all(&input.from, &mut *self.sink)?;
        }
        if self.inputs.iter().all(|input| !input.open) {
            self.sink.finish()?;
            self.ended = true;
        }
        Ok(true)
    }

    fn is_over(&self) -> bool {
        self.ended
    }

    fn counts(&self) -> StageCounts {
        StageCounts {
            stage: self.name.clone(),
            received: self
                .inputs
                .iter()
                .map(|input| input.receiver.received())
                .sum(),
            emitted: 0,
            dropped: self.sink.dropped(),
        }
    }
}
