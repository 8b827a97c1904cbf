//! Exit status of a process, in words.

use std::os::unix::process::ExitStatusExt as _;
use std::process::ExitStatus;

use crate::doctor::{self, Verdict};

/// Signal for access to a page of shared memory that the kernel cannot provide.
/// Physical: its number on Linux.
const SIGBUS: i32 = 7;

/// Describes an exit status, with the remedy if shared memory is full.
pub fn of(status: ExitStatus) -> String {
    match (status.signal(), status.code()) {
        (Some(SIGBUS), _) => bus_error(doctor::no_shared_memory()),
        (Some(signal), _) => format!("was killed by signal {signal}"),
        (None, Some(code)) => format!("ended with exit code {code}"),
        (None, None) => "ended".to_owned(),
    }
}

/// Describes a bus error; `lack` is the verdict on this host's shared memory, if it is an error.
fn bus_error(lack: Option<Verdict>) -> String {
    let Some(Verdict { found, remedy, .. }) = lack else {
        return format!("was killed by signal {SIGBUS}, a bus error");
    };
    let remedy = remedy.map_or_else(String::new, |remedy| format!("; {remedy}"));
    format!("was killed by a bus error, as {found}{remedy}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Level;

    #[test]
    fn a_bus_error_is_told_with_the_lack_of_shared_memory_and_what_to_do() {
        let lack = Verdict {
            check: "shared memory",
            level: Level::Error,
            found: "0 MB are free in /dev/shm".to_owned(),
            remedy: Some("make it larger".to_owned()),
        };
        assert_eq!(
            bus_error(Some(lack)),
            "was killed by a bus error, as 0 MB are free in /dev/shm; make it larger"
        );
        assert_eq!(bus_error(None), "was killed by signal 7, a bus error");
        assert_eq!(of(ExitStatus::from_raw(9)), "was killed by signal 9");
    }
}
