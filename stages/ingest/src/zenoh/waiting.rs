//! Messages as they come from Zenoh.

use tauscope_archive::ros::JointStateType;
use zenoh::bytes::ZBytes;
use zenoh::key_expr::KeyExpr;

use super::attachment::Attachment;

/// Which part of a sample a message brings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Role {
    State,
    Command,
    Reference,
    Tool,
    Learn,
}

/// A message as it came.
#[derive(Debug)]
pub(super) struct Waiting {
    pub role: Role,
    /// The type of its joint state, where the key tells it.
    pub joint_state_type: Option<JointStateType>,
    pub received_ns: i64,
    pub key: KeyExpr<'static>,
    pub payload: ZBytes,
    pub attachment: Option<Attachment>,
}
