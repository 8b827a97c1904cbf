//! A survey of one topic: all of its messages taken, with publishers and findings.

use tauscope_archive::{ArchiveError, Recording};

use crate::assembler::Taken;
use crate::error::SessionError;
use crate::finding::Finding;
use crate::look::{Joints, Look};
use crate::plausible::Plausible;
use crate::publisher::Publisher;

/// Publishers and findings of a topic.
#[derive(Debug, Clone, PartialEq)]
pub struct Survey {
    /// The publishers, in the order of their first messages.
    pub publishers: Vec<Publisher>,
    /// Findings.
    pub findings: Vec<Finding>,
}

impl Survey {
    /// Reads all of a topic, once, with bounded memory.
    ///
    /// # Errors
    /// If the recording can no longer be read.
    pub fn of(recording: &Recording, topic: &str) -> Result<Self, SessionError> {
        let remarks = recording.remarks().iter().cloned();
        let mut findings: Vec<Finding> = remarks.map(|remark| Finding::Format { remark }).collect();
        let look = match Look::at(recording, Some(topic), Joints::default()) {
            Ok(look) => look,
            Err(SessionError::Unusable { why, .. }) => {
                findings.extend(why.into_finding());
                return Ok(Self {
                    publishers: Vec::new(),
                    findings,
                });
            }
            Err(error) => return Err(error),
        };
        let mut assembler = look.assembler();
        let mut plausible = Plausible::new(look.joint_names(), None);
        let count = look.joint_names().len();
        let mut states = recording.joint_states(topic)?;
        while let Some(state) = states.next_state() {
            match state {
                Ok(state) => {
                    if let Taken::Follows(whole) | Taken::SetBack(whole) =
                        assembler.take(state.message, state.log_time_ns)
                    {
                        plausible.add_whole(&whole, count);
                    }
                }
                Err(ArchiveError::Damaged(_)) => {}
                Err(error) => assembler.undecodable(&error.reason()),
            }
        }
        // Without a robot, the list of publishers does not say which of them are used.
        let of_messages = assembler.findings().into_iter();
        findings.extend(of_messages.filter(|it| !matches!(it, Finding::Publishers { .. })));
        findings.extend(plausible.findings());
        Ok(Self {
            publishers: assembler.publishers(),
            findings,
        })
    }
}
