//! The commands, a module each: its arguments and what it does.

pub mod calibrate;
pub mod check;
pub mod evaluate;
pub mod explain;
pub mod info;
pub mod repair;
pub mod replay;
pub mod run;
pub mod schema;
pub mod simulate;
pub mod stage;
