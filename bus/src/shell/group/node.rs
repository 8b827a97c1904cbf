//! The three kinds of nodes, independent of their sample types.

use std::cell::RefCell;
use std::rc::Rc;

use super::edge::Shared;
use super::member::{Member, Post};
use super::turn::Turn;
use super::work::Work;
use crate::link::LinkError;
use crate::sample::{Sample, SampleKind};
use crate::seat::AnySender;
use crate::stage::{Sink, Source, Stage};

type Assemble<'a> =
    dyn FnOnce(&Turn, Post, Option<AnySender>) -> Result<Shared<'a>, LinkError> + Send + 'a;

/// A source, a stage or a sink, independent of its sample types.
pub struct Node<'a> {
    is_source: bool,
    /// Kind of its input; `None` for a source, and for a sink, which accepts all.
    accepts: Option<SampleKind>,
    assemble: Box<Assemble<'a>>,
}

impl<'a> Node<'a> {
    /// A source.
    pub fn source<T: Sample>(source: Box<dyn Source<T> + 'a>) -> Self {
        Self {
            is_source: true,
            ..Self::new(source, None)
        }
    }

    /// A stage.
    pub fn stage<I: Sample, O: Sample>(stage: Box<dyn Stage<I, O> + 'a>) -> Self {
        Self::new(stage, Some(I::KIND))
    }

    /// A sink.
    pub fn sink(sink: Box<dyn Sink + 'a>) -> Self {
        Self::new(sink, None)
    }

    fn new<W: Work + 'a>(work: W, accepts: Option<SampleKind>) -> Self {
        Self {
            is_source: false,
            accepts,
            assemble: Box::new(move |turn, post, output| {
                let member = Member::new(work, turn, post, output)?;
                Ok(Rc::new(RefCell::new(member)))
            }),
        }
    }

    /// Whether it is a sink.
    pub fn is_sink(&self) -> bool {
        !self.is_source && self.accepts.is_none()
    }

    /// Whether it is a source.
    pub fn is_source(&self) -> bool {
        self.is_source
    }

    pub(super) fn accepts(&self) -> Option<SampleKind> {
        self.accepts
    }

    pub(super) fn assemble(
        self,
        turn: &Turn,
        post: Post,
        output: Option<AnySender>,
    ) -> Result<Shared<'a>, LinkError> {
        (self.assemble)(turn, post, output)
    }
}
