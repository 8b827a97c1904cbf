//! Messages received from Zenoh.

use tauscope_archive::ros::JointStateType;
use zenoh::bytes::ZBytes;
use zenoh::key_expr::KeyExpr;

use super::attachment::Attachment;

/// Part of a sample that a message supplies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Role {
    State,
    Command,
    Reference,
    Tool,
    Learn,
}

/// A received message that is not decoded yet.
#[derive(Debug)]
pub(super) struct Waiting {
    pub role: Role,
    /// Type of its joint state, if the key contains it.
    pub joint_state_type: Option<JointStateType>,
    pub received_ns: i64,
    pub key: KeyExpr<'static>,
    pub payload: ZBytes,
    pub attachment: Option<Attachment>,
}
