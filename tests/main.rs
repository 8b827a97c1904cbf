//! Tests of the whole program, a file for each subject.
//!
//! They are one test program, because linking tauscope takes seconds per program. Also, tests that wait run in
//! parallel with tests that compute.

mod archives;
mod bad_input;
mod bad_learnt;
mod calibrate;
mod check;
mod clean_hour;
mod common;
mod deploy;
mod docs;
mod doctor;
mod durable;
mod evaluate;
mod explain;
mod export;
mod fleet;
mod formats;
mod independent_reader;
mod init;
mod init_live;
mod interrupt;
mod kill_stage;
mod learning;
mod next_motion;
mod noted;
mod outside_stage;
mod physics;
mod pipeline_doc;
mod processes;
mod prose;
mod publish;
mod python;
mod real_recordings;
mod replace;
mod replay;
mod run;
mod same_contact;
mod secure_router;
mod shell;
mod silence;
mod simulators;
mod slips;
mod streaming;
mod supervision;
mod trials;
mod two_hosts;
mod ur_rtde;
mod watch;
mod watch_suite;
