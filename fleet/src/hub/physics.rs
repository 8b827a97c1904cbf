//! Periodic reading of the nightly tables, on a thread of its own.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::{TICK, unix_ns};
use crate::physics::{self, CellPhysics};
use crate::store::{KEPT_NS, Store, baselines};

/// Interval between readings of the nightly tables. Resolution: they come once a night, and a note takes effect
/// within minutes.
const PHYSICS_EVERY: Duration = Duration::from_mins(5);
/// Reads the nightly tables periodically until the fleet host stops.
pub fn follow(
    folder: &Path,
    notes: Option<&Store>,
    known: &Mutex<Vec<CellPhysics>>,
    stop: &AtomicBool,
) {
    let mut told = false;
    while !stop.load(Ordering::Relaxed) {
        let since_day = unix_ns().saturating_sub(KEPT_NS) as f64 / 86_400e9;
        let of_cell = |cell: &str| notes.and_then(|store| store.notes(cell, u32::MAX).ok());
        let begins = |cell: &str| of_cell(cell).map_or_else(Vec::new, |notes| baselines(&notes));
        match physics::read(folder, since_day, &begins) {
            Ok((cells, unread)) => {
                if let Some(error) = unread.first().filter(|_| !told) {
                    told = true;
                    tracing::warn!("{error}; {} tables are left out", unread.len());
                }
                *known.lock().unwrap_or_else(PoisonError::into_inner) = cells;
            }
            Err(error) if !told => {
                told = true;
                tracing::warn!("nightly physics: {error}");
            }
            Err(_) => {}
        }
        let read = Instant::now();
        while read.elapsed() < PHYSICS_EVERY && !stop.load(Ordering::Relaxed) {
            std::thread::sleep(TICK);
        }
    }
}
