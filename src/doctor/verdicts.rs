//! Verdicts on the facts about the machine.

use std::path::Path;

use super::facts::{Endpoint, Facts, Folder, SHARED_MEMORY, Validity, Way};
use super::{Level, Verdict};

/// Free shared memory below which no run starts \[MB\]. The bundled pipeline touches 0.9 MB while its stages keep up
/// (`df /dev/shm` while it runs), and more while one lags.
/// Resolution: a run without free shared memory ends with a bus error.
const LEAST_SHARED_MB: f64 = 4.0;
/// Free shared memory below which a cell may fail while all of its stages lag \[MB\].
/// Resolution: the memory that four stages reserve.
const AMPLE_SHARED_MB: f64 = 50.0;
/// Upper bound on the open files of a process with a dozen streams.
/// Resolution: the common default limit.
const LEAST_OPEN_FILES: u64 = 1024;
/// Remaining validity of a certificate below which a warning is given \[days\].
/// Resolution: time to have a new one issued.
const SOON_DAYS: i64 = 30;
/// Remaining recording time of a disk below which a warning is given \[days\].
/// Resolution: time to notice over a weekend.
const FEW_DAYS: f64 = 3.0;
/// Error of the clock above which a warning is given \[s\]. The times of two hosts with this error differ by at most
/// two samples at 100 Hz.
/// Resolution: the sampling rate of the slowest common robots.
const CLOCK_ERROR_S: f64 = 0.01;
/// Clock sources that are slow to read.
const SLOW_CLOCKS: [&str; 4] = ["acpi_pm", "hpet", "jiffies", "pit"];

/// Returns the verdicts of all checks.
pub fn all(facts: &Facts) -> Vec<Verdict> {
    let mut verdicts = vec![Verdict::ok(
        "versions",
        format!(
            "tauscope {}, Linux {}",
            env!("CARGO_PKG_VERSION"),
            facts.kernel
        ),
    )];
    verdicts.extend(facts.shared_memory.as_ref().map(shared_memory));
    verdicts.extend(facts.left_behind.as_ref().map(left_behind));
    verdicts.push(clock_source(facts.clock_source.as_deref()));
    verdicts.push(clock_synchronised(facts.clock_synchronised));
    verdicts.extend(facts.clock_error_s.map(clock_offset));
    verdicts.push(open_files(facts.open_files));
    verdicts.push(locked(facts.locked_bytes));
    verdicts.extend(facts.folders.iter().map(folder));
    verdicts.extend(facts.endpoints.iter().map(endpoint));
    let certificates = facts.certificates.iter();
    verdicts.extend(certificates.map(|(path, valid)| certificate(path, valid, facts.now_s)));
    let keys = facts.private_keys.iter();
    verdicts.extend(keys.map(|(path, usable)| private_key(path, usable)));
    verdicts
}

pub(super) fn shared_memory(free: &Result<u64, String>) -> Verdict {
    const CHECK: &str = "shared memory";
    let free = match free {
        Ok(free) => *free as f64 * 1e-6,
        Err(error) => {
            let found = format!("{SHARED_MEMORY} cannot be written to: {error}");
            let remedy = "mount a tmpfs there that this user may write to";
            return Verdict::bad(CHECK, Level::Error, found, remedy);
        }
    };
    let found = format!("{free:.0} MB are free in {SHARED_MEMORY}");
    let remedy =
        "make it larger: `mount -o remount,size=1G /dev/shm`; in a container `--shm-size=1g`";
    if free < LEAST_SHARED_MB {
        Verdict::bad(CHECK, Level::Error, found, remedy)
    } else if free < AMPLE_SHARED_MB {
        Verdict::bad(CHECK, Level::Warning, found, remedy)
    } else {
        Verdict::ok(CHECK, found)
    }
}

fn left_behind(left: &Result<usize, String>) -> Verdict {
    const CHECK: &str = "leftovers";
    match left {
        Ok(0) => Verdict::ok(CHECK, "killed runs have left nothing"),
        Ok(runs) => Verdict::bad(
            CHECK,
            Level::Warning,
            format!("{runs} killed runs have left files in /tmp and {SHARED_MEMORY}"),
            "the next `tauscope run` of the user who started them removes them",
        ),
        Err(error) => Verdict::bad(
            CHECK,
            Level::Warning,
            format!("what killed runs have left cannot be seen: {error}"),
            "run it as the user whom the pipeline runs as",
        ),
    }
}

fn clock_source(source: Option<&str>) -> Verdict {
    const CHECK: &str = "clock source";
    match source {
        Some(slow) if SLOW_CLOCKS.contains(&slow) => Verdict::bad(
            CHECK,
            Level::Warning,
            format!("the kernel takes the time from {slow}, which is slow to read"),
            "see `dmesg` for why it does not use tsc; on a virtual machine kvm-clock",
        ),
        Some(source) => Verdict::ok(CHECK, source),
        None => Verdict::ok(CHECK, "the kernel does not say"),
    }
}

fn clock_synchronised(synchronised: Option<bool>) -> Verdict {
    const CHECK: &str = "clock";
    match synchronised {
        Some(true) => Verdict::ok(CHECK, "synchronised"),
        Some(false) => Verdict::bad(
            CHECK,
            Level::Warning,
            "not synchronised: times of several hosts cannot be compared",
            "`timedatectl set-ntp true`, or install chrony",
        ),
        None => Verdict::ok(CHECK, "systemd does not say whether it is synchronised"),
    }
}

/// Judges the error of the clock. Two synchronised hosts differ by at most the sum of their errors.
fn clock_offset(error_s: f64) -> Verdict {
    const CHECK: &str = "clock offset";
    let found = format!(
        "at most {:.3} ms from that of the time servers",
        error_s * 1e3
    );
    if error_s <= CLOCK_ERROR_S {
        return Verdict::ok(CHECK, found);
    }
    let remedy = "wait until chrony has settled (`chronyc tracking`), or give it a nearer server, the same \
                  one on all hosts; PTP where that is not enough";
    Verdict::bad(CHECK, Level::Warning, found, remedy)
}

fn open_files(limit: Option<u64>) -> Verdict {
    const CHECK: &str = "open files";
    match limit {
        Some(limit) if limit < LEAST_OPEN_FILES => Verdict::bad(
            CHECK,
            Level::Warning,
            format!("a process may have {limit} open"),
            format!("`ulimit -n {LEAST_OPEN_FILES}`; in a systemd unit `LimitNOFILE=`"),
        ),
        Some(limit) => Verdict::ok(CHECK, format!("a process may have {limit} open")),
        None => Verdict::ok(CHECK, "no limit"),
    }
}

/// Reports the limit on locked memory, for information only: tauscope locks none.
fn locked(limit: Option<u64>) -> Verdict {
    let found = limit.map_or_else(
        || "no limit".to_owned(),
        |bytes| format!("{} KiB (none is needed)", bytes >> 10),
    );
    Verdict::ok("locked memory", found)
}

fn folder(folder: &Folder) -> Verdict {
    const CHECK: &str = "disk";
    let path = if folder.path == Path::new("") {
        Path::new(".")
    } else {
        &folder.path
    };
    let path = path.display();
    if let Err(error) = &folder.writable {
        let found = format!("cannot write into {path}: {error}");
        let remedy = "give the recorder a folder that this user may write to, or change its rights";
        return Verdict::bad(CHECK, Level::Error, found, remedy);
    }
    let Some(free_bytes) = folder.free_bytes else {
        return Verdict::ok(
            CHECK,
            format!("{path}: the file system does not say its room"),
        );
    };
    let free_mb = free_bytes as f64 * 1e-6;
    let mut found = format!("{path}: {free_mb:.0} MB are free");
    let remedy = "remove old recordings, give another folder, or let the oldest go with `keep`";
    if free_mb < folder.min_free_mb {
        found += &format!(", recording pauses below {}", folder.min_free_mb);
        return Verdict::bad(CHECK, Level::Error, found, remedy);
    }
    let Some(bytes_a_day) = folder.bytes_a_day else {
        return Verdict::ok(CHECK, found);
    };
    let days = (free_mb - folder.min_free_mb) * 1e6 / bytes_a_day;
    found += &format!(", enough for {days:.1} days at the rate of the newest archive there");
    if days < FEW_DAYS {
        Verdict::bad(CHECK, Level::Warning, found, remedy)
    } else {
        Verdict::ok(CHECK, found)
    }
}

fn endpoint(endpoint: &Endpoint) -> Verdict {
    let Endpoint {
        of,
        at,
        is,
        possible,
    } = endpoint;
    // The settings after `?` and `#` may contain secrets.
    let shown = at.split(['?', '#']).next().unwrap_or(at);
    match (possible, is) {
        (Ok(()), Way::Listen) => Verdict::ok("port", format!("{of}: {shown} is free")),
        (Ok(()), Way::Connect) => Verdict::ok("peer", format!("{of}: {shown} answers")),
        (Ok(()), Way::Controller) => Verdict::ok("controller", format!("{of}: {shown} answers")),
        (Err(error), Way::Controller) => Verdict::bad(
            "controller",
            Level::Error,
            format!("{of} cannot reach the robot's controller at {shown}: {error}"),
            "switch it on, compare `host` with the address that it shows, allow RTDE in its settings \
             (Security, Services), and look at cable and firewall",
        ),
        (Err(error), Way::Listen) => Verdict::bad(
            "port",
            Level::Error,
            format!("{of} cannot listen on {shown}: {error}"),
            "end the program that listens there (`ss -ltnp` names it; it may be this pipeline), or \
             give another port",
        ),
        (Err(error), Way::Connect) => Verdict::bad(
            "peer",
            Level::Error,
            format!("{of} cannot reach {shown}: {error}"),
            "start the router or peer there, or look at address, cable and firewall",
        ),
    }
}

fn certificate(path: &Path, valid: &Validity, now_s: i64) -> Verdict {
    const CHECK: &str = "certificate";
    let path = path.display();
    let (from_s, to_s) = match valid {
        Ok(valid) => *valid,
        Err(error) => {
            let found = format!("{path} cannot be used: {error}");
            let remedy = "give the path of a certificate in PEM form that this user may read";
            return Verdict::bad(CHECK, Level::Error, found, remedy);
        }
    };
    if now_s < from_s {
        let found = format!("{path} does not hold yet");
        return Verdict::bad(CHECK, Level::Error, found, "set the clock, or wait");
    }
    let days = (to_s - now_s).div_euclid(86_400);
    let remedy = "have a new one made";
    if days < 0 {
        let found = format!("{path} has run out {} days ago", -days);
        return Verdict::bad(CHECK, Level::Error, found, remedy);
    }
    let found = format!("{path} holds for {days} days");
    if days < SOON_DAYS {
        Verdict::bad(CHECK, Level::Warning, found, remedy)
    } else {
        Verdict::ok(CHECK, found)
    }
}

fn private_key(path: &Path, usable: &Result<(), String>) -> Verdict {
    const CHECK: &str = "private key";
    let path = path.display();
    match usable {
        Ok(()) => Verdict::ok(CHECK, format!("{path} can be read")),
        Err(error) => Verdict::bad(
            CHECK,
            Level::Error,
            format!("{path} cannot be used: {error}"),
            "give the path of the key in PEM form, and let this user read it",
        ),
    }
}

#[cfg(test)]
mod tests;
