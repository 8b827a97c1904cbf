//! All tests of the public API in one program, because linking dominates the build time.

mod archive;
mod around_alarms;
mod explanation;
mod files;
mod picture;
mod synthetic;
