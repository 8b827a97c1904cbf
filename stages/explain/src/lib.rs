//! Why a twin and a recording differ: locate the mismatch, name the physics that was left out, model it and prove it
//! on recordings that were never fitted.

mod across;
pub mod active;
mod at_rest;
mod audit;
mod bodies;
mod body_prior;
mod body_step;
mod columns;
pub mod drive;
mod efforts;
pub mod explain;
mod findings;
pub mod fit;
mod friction;
pub mod html;
mod in_motion;
pub mod interval;
pub mod least_squares;
pub mod library;
mod locate;
mod next_motion;
mod parallel;
mod parts;
pub mod problem;
mod proof;
pub mod propose;
pub mod recording;
mod refine;
pub mod report;
pub mod search;
pub mod smoother;
mod standstill;
mod start;
pub mod track;
mod trial;
mod unknown;
mod verdict;
mod wall;
pub mod watch;
pub mod windows;
mod words;
mod worth;

pub use explain::{Input, Outcome, explain};
pub use recording::{Recording, RecordingError, RecordingTopics};
pub use start::Start;
