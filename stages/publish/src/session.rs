//! The Zenoh session of a publisher.

use tauscope_bus::{LinkError, ZenohEndpoints};
use zenoh::Session;

use crate::config::{Config, ZenohConfig};
use crate::setup::Setup;

/// Opens the session over which the publisher sends messages and commands, if it has endpoints.
pub(crate) fn session(config: &Config, setup: &Setup) -> Result<Option<Session>, LinkError> {
    // Subscribers of ROS 2 and JSON may be peers behind the same router, and such peers receive from routers only.
    let has_topics = |zenoh: &ZenohConfig| zenoh.json || zenoh.ros2.is_some();
    let open = if config.zenoh.as_ref().is_some_and(has_topics) {
        ZenohEndpoints::session
    } else {
        ZenohEndpoints::session_for_routers
    };
    endpoints(config, setup).map(|at| open(&at)).transpose()
}

/// Returns the endpoints of the session: those in the configuration, and those at which the source accepts commands.
fn endpoints(config: &Config, setup: &Setup) -> Option<ZenohEndpoints> {
    let zenoh = config.zenoh.as_ref().map(|zenoh| ZenohEndpoints {
        listen: zenoh.listen.clone(),
        connect: zenoh.connect.clone(),
    });
    let mut all = match (zenoh, &setup.commands) {
        (None, None) => return None,
        (zenoh, _) => zenoh.unwrap_or_default(),
    };
    for endpoint in setup.commands.iter().flat_map(ZenohEndpoints::reached_at) {
        if !all.connect.contains(&endpoint) && !all.listen.contains(&endpoint) {
            all.connect.push(endpoint);
        }
    }
    Some(all)
}
