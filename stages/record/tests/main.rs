//! One program of the tests through the public face: linking one is what takes long.

mod archive;
mod around_alarms;
mod explanation;
mod files;
mod picture;
mod synthetic;
