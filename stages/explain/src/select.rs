//! Step 5, select: which effects, together, explain what the twin leaves.

pub mod candidates;
pub mod cross_validation;
pub mod curve_shapes;
pub mod curves;
pub mod evidence;
pub mod exchange;
pub mod explanation;
pub mod forward;
pub mod free_body;
pub mod nested;
pub mod parallel;
pub mod plausible;
pub mod propose;
pub mod prune;
pub mod search;
pub mod split_push;
pub mod trial;
pub mod wall;
pub mod windows;
