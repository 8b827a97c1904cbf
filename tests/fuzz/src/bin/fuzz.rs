//! A target under libFuzzer. Which one is the program's own name says: `tests/fuzz/run.sh` links it under each.
#![no_main]
#![allow(unsafe_code, reason = "libFuzzer is entered from C")]
#![allow(missing_docs, reason = "libFuzzer's macro makes a function")]

use std::path::Path;
use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;
use tauscope_fuzz::{TARGETS, Take};

fn target() -> Take {
    static TARGET: OnceLock<Take> = OnceLock::new();
    *TARGET.get_or_init(|| {
        let program = std::env::args_os().next().unwrap_or_default();
        let name = Path::new(&program).file_name().unwrap_or_default();
        let found = TARGETS.iter().find(|target| *name == *target.name);
        let names = || TARGETS.map(|target| target.name).join(", ");
        found
            .unwrap_or_else(|| panic!("link this program under the name of a target: {}", names()))
            .take
    })
}

fuzz_target!(|bytes: &[u8]| {
    target()(bytes);
});
