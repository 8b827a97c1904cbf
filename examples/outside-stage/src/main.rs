//! A stage outside tauscope: one `Stage`, one line of `main`.

use std::process::ExitCode;

use outside_stage::{Config, PeakResidual};
use tauscope_bus::{Seat, shell};

fn main() -> ExitCode {
    shell::outside(|seat: &Seat| Config::of(seat).map(PeakResidual::new))
}
