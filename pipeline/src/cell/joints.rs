//! The joints that a recording names.

use std::path::Path;

use tauscope_archive::Recording;

use crate::report::{Problem, Report};

/// The joints of the first message that can be read, in its order.
///
/// # Errors
/// If the recording cannot be read or has no joint states on the topic.
pub fn first_joint_names(path: &Path, topic: &str) -> Result<Vec<String>, Report> {
    let wrong = |title: String| Report::from(Problem::new(title));
    let archive = Recording::open(path).map_err(|error| wrong(error.to_string()))?;
    let mut states = archive
        .joint_states(topic)
        .map_err(|error| wrong(error.to_string()))?;
    while let Some(state) = states.next_state() {
        if let Ok(state) = state
            && !state.message.name.is_empty()
        {
            return Ok(state.message.name.clone());
        }
    }
    let path = path.display();
    Err(wrong(format!(
        "{path}: no message on `{topic}` names its joints"
    )))
}
