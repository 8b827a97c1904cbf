//! Temperature of the joints while they were recorded.

use std::path::Path;

use tauscope_archive::ArchiveError;
use tauscope_archive::ros::Temperature;

use super::night::LONGEST_S;
use super::open;
use crate::exit::Failure;

/// Returns the mean temperature by joint over the measured part of some recordings \[deg C\]. A message is of the
/// joint that its frame names, or of all joints if its frame is empty; `None` for a joint without a message.
pub fn of_joints<'a>(
    recordings: impl Iterator<Item = &'a Path>,
    topic: &str,
    joints: &[String],
) -> Result<Vec<Option<f64>>, Failure> {
    let mut sums = vec![(0.0, 0_u32); joints.len()];
    let failed = |error: ArchiveError| Failure::rejected(error.to_string());
    for path in recordings {
        let archive = open(path)?;
        archive.topic_of::<Temperature>(topic).map_err(failed)?;
        let end_ns = archive
            .start_ns()
            .unwrap_or(0)
            .saturating_add((LONGEST_S * 1e9) as i64);
        let mut messages = archive.messages(&[topic]).map_err(failed)?;
        while let Some(message) = messages.next_message() {
            // Damaged messages are counted where the joint states are read.
            let Ok(message) = message else { continue };
            if message.log_time_ns > end_ns {
                break;
            }
            let Ok(told) = message.decode::<Temperature>() else {
                continue;
            };
            let frame = told.header.frame_id.as_str();
            for (joint, (sum, count)) in joints.iter().zip(&mut sums) {
                if (frame.is_empty() || frame == joint) && told.temperature.is_finite() {
                    *sum += told.temperature;
                    *count += 1;
                }
            }
        }
    }
    let mean = |(sum, count): (f64, u32)| (count > 0).then(|| sum / f64::from(count));
    Ok(sums.into_iter().map(mean).collect())
}
