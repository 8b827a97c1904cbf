//! Step 1, read: recordings become columns of numbers, and it is decided whether they allow a verdict at all.
//!
//! In: recordings at rest (MCAP, rosbag2, CSV), the robot, and a corrected twin if there is one to start from. Out:
//! an [`input::Input`] whose recordings have strictly increasing time and one number per joint and sample, in URDF
//! order; every row that was dropped is counted. Or a reason why nothing can be evaluated, such as effort that is zero
//! throughout.

pub mod audit;
pub mod excerpt;
pub mod input;
pub mod recording;
pub mod start;
