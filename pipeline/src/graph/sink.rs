//! The end of a graph: streams of any type into one sink.

use std::time::Duration;

use tauscope_bus::{Received, Receiver, Sample, SampleRef, Sink, StageError};

use super::{Node, StageCounts};

/// A receiver whose sample type is known at run time only.
trait AnyInput {
    fn take(
        &mut self,
        read: &mut dyn FnMut(SampleRef<'_>) -> Result<(), StageError>,
    ) -> Result<Received, StageError>;
    fn counts(&self) -> tauscope_bus::ReceiverCounts;
}

impl<T: Sample> AnyInput for Box<dyn Receiver<T>> {
    fn take(
        &mut self,
        read: &mut dyn FnMut(SampleRef<'_>) -> Result<(), StageError>,
    ) -> Result<Received, StageError> {
        let mut result = Ok(());
        let received =
            self.receive(Duration::ZERO, &mut |sample| result = read(sample.as_ref()))?;
        result?;
        Ok(received)
    }

    fn counts(&self) -> tauscope_bus::ReceiverCounts {
        (**self).counts()
    }
}

/// One of the streams that a sink listens to.
pub struct SinkInput {
    from: String,
    receiver: Box<dyn AnyInput>,
    open: bool,
}

impl SinkInput {
    /// The stream of the stage `from`.
    pub(super) fn new<T: Sample>(from: &str, receiver: Box<dyn Receiver<T>>) -> Self {
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
        for SinkInput {
            from,
            receiver,
            open,
        } in &mut self.inputs
        {
            while *open {
                match receiver.take(&mut |sample| self.sink.accept(from, sample))? {
                    Received::Sample => {}
                    Received::Nothing => break,
                    Received::End => *open = false,
                }
            }
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
        let counts = self.inputs.iter().map(|input| input.receiver.counts());
        let (received, lost) = counts.fold((0, 0), |(r, l), c| (r + c.received, l + c.lost));
        StageCounts {
            stage: self.name.clone(),
            received,
            emitted: 0,
            dropped: lost + self.sink.dropped(),
        }
    }
}
