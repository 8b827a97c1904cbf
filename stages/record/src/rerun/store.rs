//! Conversion of columns to the messages of a Rerun store.
//!
//! It replaces Rerun's `RecordingStream`, so that buffers are bounded, errors are returned, and environment variables
//! have no effect.

use rerun::external::re_log_types::{SetStoreInfo, StoreInfo, StoreSource};
use rerun::external::re_types_core::ChunkId;
use rerun::log::{Chunk, ChunkComponents, LogMsg, RowId};
use rerun::{
    AsComponents, EntityPath, SerializationError, SerializedComponentColumn, StoreId, TimeColumn,
    TimePoint,
};

use crate::error::RecordError;

/// Receiver of messages.
pub(super) type Out<'a> = dyn FnMut(LogMsg) -> Result<(), RecordError> + 'a;

/// A recording or a blueprint.
#[derive(Debug, Clone)]
pub(super) struct Store {
    pub id: StoreId,
}

impl Store {
    /// The message that announces it.
    pub fn announcement(&self) -> LogMsg {
        let source = StoreSource::Other(concat!("tauscope ", env!("CARGO_PKG_VERSION")).to_owned());
        LogMsg::SetStoreInfo(SetStoreInfo {
            row_id: *RowId::new(),
            info: StoreInfo::new(self.id.clone(), source),
        })
    }

    /// Message with static data.
    pub fn always(
        &self,
        entity: &EntityPath,
        what: &dyn AsComponents,
    ) -> Result<LogMsg, RecordError> {
        self.at(TimePoint::default(), entity, what)
    }

    /// Message with data that is valid from a time on.
    pub fn at(
        &self,
        time: TimePoint,
        entity: &EntityPath,
        what: &dyn AsComponents,
    ) -> Result<LogMsg, RecordError> {
        let chunk = Chunk::builder(entity.clone())
            .with_archetype_auto_row(time, what)
            .build();
        self.message(entity, chunk)
    }

    /// Message with many rows, one per time.
    pub fn columns(
        &self,
        entity: &EntityPath,
        times: impl IntoIterator<Item = TimeColumn>,
        columns: impl Iterator<Item = SerializedComponentColumn>,
    ) -> Result<LogMsg, RecordError> {
        let times = times
            .into_iter()
            .map(|column| (*column.timeline().name(), column))
            .collect();
        let columns: ChunkComponents = columns
            .map(|column| (column.descriptor, column.list_array))
            .collect();
        self.message(
            entity,
            Chunk::from_auto_row_ids(ChunkId::new(), entity.clone(), times, columns),
        )
    }

    fn message<E: std::fmt::Display>(
        &self,
        entity: &EntityPath,
        chunk: Result<Chunk, E>,
    ) -> Result<LogMsg, RecordError> {
        let failed = |reason: String| RecordError::Encode {
            entity: entity.to_string(),
            reason,
        };
        let chunk = chunk.map_err(|error| failed(error.to_string()))?;
        let arrow = chunk
            .to_arrow_msg()
            .map_err(|error| failed(error.to_string()))?;
        Ok(LogMsg::ArrowMsg(self.id.clone(), arrow))
    }
}

/// Creates the error for an entity that cannot be serialised.
pub(super) fn unserializable(entity: &EntityPath) -> impl Fn(SerializationError) -> RecordError {
    let entity = entity.to_string();
    move |error| RecordError::Encode {
        entity: entity.clone(),
        reason: error.to_string(),
    }
}

/// Entity path of a topic with further parts. Each part is literal.
pub(super) fn entity(topic: &str, below: &[&str]) -> EntityPath {
    let parts = topic
        .split('/')
        .filter(|part| !part.is_empty())
        .chain(below.iter().copied());
    EntityPath::new(parts.map(Into::into).collect())
}
