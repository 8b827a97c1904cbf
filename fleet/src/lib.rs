//! All cells at once: what each one tells, how fresh that is, its incidents, a page and metrics.

#[cfg(test)]
mod fixture;
pub mod inbox;
pub mod wall;
pub mod mailbox;
pub mod store;
