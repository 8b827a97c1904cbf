//! Facts about the machine.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

use rustix::process::{Resource, getrlimit};
use tauscope_archive::whole_file;
use tauscope_pipeline::pipeline::stages::ingest::IngestSettings;
use tauscope_pipeline::pipeline::stages::publish::PublishSettings;
use tauscope_pipeline::pipeline::{Pipeline, Stage};

use super::{certificate, endpoint};

/// Mount point of the shared memory.
pub const SHARED_MEMORY: &str = "/dev/shm";

/// Start and end of a certificate's validity \[s since the epoch\], or why it cannot be read.
pub type Validity = Result<(i64, i64), String>;

/// Facts about the machine; an error text in place of one that cannot be read.
#[derive(Debug, Clone, Default)]
pub struct Facts {
    /// Free shared memory \[bytes\].
    pub shared_memory: Option<Result<u64, String>>,
    /// Number of killed runs that left files behind.
    pub left_behind: Option<Result<usize, String>>,
    /// Clock source of the kernel.
    pub clock_source: Option<String>,
    /// Whether the clock is synchronised with a time server.
    pub clock_synchronised: Option<bool>,
    /// Upper bound on the error of the clock, from chrony \[s\].
    pub clock_error_s: Option<f64>,
    /// Limit on the open files of a process; `None` if there is no limit.
    pub open_files: Option<u64>,
    /// Limit on the locked memory of a process \[bytes\]; `None` if there is no limit.
    pub locked_bytes: Option<u64>,
    /// Folders that recorders write to.
    pub folders: Vec<Folder>,
    /// Endpoints that stages listen on or connect to.
    pub endpoints: Vec<Endpoint>,
    /// Certificates, with their validity.
    pub certificates: Vec<(PathBuf, Validity)>,
    /// Private keys, and whether they are usable.
    pub private_keys: Vec<(PathBuf, Result<(), String>)>,
    /// Current time \[s since the epoch\].
    pub now_s: i64,
    /// Version of the kernel.
    pub kernel: String,
}

/// A folder that a recorder writes to.
#[derive(Debug, Clone)]
pub struct Folder {
    /// Path of the folder.
    pub path: PathBuf,
    /// Whether files can be created in it, or why not.
    pub writable: Result<(), String>,
    /// Free space on its disk \[bytes\].
    pub free_bytes: Option<u64>,
    /// Free space below which recording pauses \[MB\].
    pub min_free_mb: f64,
    /// Data rate of the newest archive in it \[bytes/day\].
    pub bytes_a_day: Option<f64>,
}

/// An endpoint of a stage.
#[derive(Debug, Clone)]
pub struct Endpoint {
    /// Name of the stage or host.
    pub of: String,
    /// The endpoint as written in the pipeline file.
    pub at: String,
    /// Use of the endpoint.
    pub is: Way,
    /// Whether this use is possible now, or why not.
    pub possible: Result<(), String>,
}

/// Use of an endpoint by a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// The stage listens on it.
    Listen,
    /// The stage connects to it: a router or another host.
    Connect,
    /// The stage connects to it: the robot's controller.
    Controller,
}

/// Reads the facts about the machine, and about everything that `pipeline` uses on `host`.
pub fn read(pipeline: Option<&Pipeline>, host: Option<&str>) -> Facts {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let mut facts = Facts {
        shared_memory: Some(shared_memory()),
        left_behind: Some(
            tauscope_bus::link::left_behind()
                .map(|domains| domains.len())
                .map_err(|error| error.to_string()),
        ),
        clock_source: line_of("/sys/devices/system/clocksource/clocksource0/current_clocksource"),
        clock_synchronised: clock_synchronised(),
        clock_error_s: clock_error_s(),
        open_files: getrlimit(Resource::Nofile).current,
        locked_bytes: getrlimit(Resource::Memlock).current,
        now_s: now.map_or(0, |since| since.as_secs() as i64),
        kernel: line_of("/proc/sys/kernel/osrelease").unwrap_or_default(),
        ..Facts::default()
    };
    let Some(pipeline) = pipeline else {
        return facts;
    };
    let here = |stage: &&Stage| host.is_none() || stage.host.as_deref() == host;
    let mut endpoints = Vec::new();
    for stage in pipeline.stages.iter().filter(here) {
        endpoints_of(stage, &mut endpoints);
        if let Some(config) = stage.settings.get::<tauscope_record::Config>() {
            let cell = stage.cells.first().map_or("", String::as_str);
            let mut folders = config.folders(cell);
            folders.dedup();
            let folders = folders.iter().map(|path| folder(path, config.min_free_mb));
            facts.folders.extend(folders);
        }
    }
    for (name, entry) in &pipeline.hosts {
        if host == Some(name) {
            endpoints.extend(
                entry
                    .listen
                    .0
                    .iter()
                    .map(|at| (name.clone(), at.clone(), Way::Listen)),
            );
            endpoints.extend(
                entry
                    .connect
                    .0
                    .iter()
                    .map(|at| (name.clone(), at.clone(), Way::Connect)),
            );
        }
    }
    let (mut certificates, mut keys) = (BTreeMap::new(), BTreeMap::new());
    for (_, endpoint, _) in &endpoints {
        for path in endpoint::certificates(endpoint) {
            let validity = certificate::validity(&path);
            certificates.insert(path, validity);
        }
        for path in endpoint::private_keys(endpoint) {
            let usable = certificate::usable_key(&path);
            keys.insert(path, usable);
        }
    }
    facts.certificates = certificates.into_iter().collect();
    facts.private_keys = keys.into_iter().collect();
    facts.endpoints = endpoints.into_iter().filter_map(tried).collect();
    facts
}

pub(super) fn shared_memory() -> Result<u64, String> {
    let path = Path::new(SHARED_MEMORY);
    whole_file::check_writable(path)
        .and_then(|()| whole_file::free_bytes(path))
        .map_err(|error| error.to_string())
}

fn line_of(path: &str) -> Option<String> {
    Some(fs::read_to_string(path).ok()?.trim().to_owned())
}

/// Returns the bound on the clock's error by chrony's manual: the offset, the root dispersion and half of the root
/// delay.
fn clock_error_s() -> Option<f64> {
    let asked = Command::new("chronyc").args(["-c", "tracking"]).output();
    let said = asked.ok().filter(|asked| asked.status.success())?;
    tracked_error_s(&String::from_utf8_lossy(&said.stdout))
}

/// Returns this bound from a line of `chronyc -c tracking`.
pub(super) fn tracked_error_s(line: &str) -> Option<f64> {
    let fields: Vec<&str> = line.trim().split(',').collect();
    let number = |at: usize| fields.get(at)?.parse::<f64>().ok();
    // Stratum 0: not synchronised with any server.
    (number(2)? > 0.0).then_some(())?;
    Some(number(4)?.abs() + number(11)? + 0.5 * number(10)?)
}

/// Asks systemd whether the clock is synchronised, else looks for the file of its client; `None` if both fail.
fn clock_synchronised() -> Option<bool> {
    let mut ask = Command::new("timedatectl");
    let asked = ask
        .args(["show", "-p", "NTPSynchronized", "--value"])
        .output();
    let said = asked.ok().filter(|asked| asked.status.success());
    match said.as_ref().map(|said| said.stdout.trim_ascii()) {
        Some(b"yes") => Some(true),
        Some(b"no") => Some(false),
        _ => Path::new("/run/systemd/timesync/synchronized")
            .exists()
            .then_some(true),
    }
}

fn folder(path: &Path, min_free_mb: f64) -> Folder {
    Folder {
        path: path.to_owned(),
        writable: whole_file::check_writable(path).map_err(|error| error.to_string()),
        free_bytes: whole_file::free_bytes(path).ok(),
        min_free_mb,
        bytes_a_day: bytes_a_day(path),
    }
}

/// Returns the data rate of the newest archive in a folder \[bytes/day\].
fn bytes_a_day(folder: &Path) -> Option<f64> {
    let here = if folder == Path::new("") {
        Path::new(".")
    } else {
        folder
    };
    let files = fs::read_dir(here).ok()?.filter_map(Result::ok);
    let archives = files.filter(|file| file.path().extension().is_some_and(|kind| kind == "mcap"));
    let newest = archives.max_by_key(|file| file.metadata().and_then(|of| of.modified()).ok())?;
    let recording = tauscope_session::open(&newest.path()).ok()?;
    let seconds = recording.end_ns()?.checked_sub(recording.start_ns()?)? as f64 * 1e-9;
    (seconds > 1.0).then(|| recording.bytes() as f64 / seconds * 86_400.0)
}

/// Adds the endpoints of a stage, each with the stage's name and its use.
fn endpoints_of(stage: &Stage, endpoints: &mut Vec<(String, String, Way)>) {
    let mut add = |at: &[String], is| {
        let of = |at: &String| (stage.name.clone(), at.clone(), is);
        endpoints.extend(at.iter().map(of));
    };
    if let Some(IngestSettings { config, .. }) = stage.settings.get() {
        if let Some(zenoh) = &config.zenoh {
            add(&zenoh.listen, Way::Listen);
            add(&zenoh.connect, Way::Connect);
        }
        if let Some(ur) = &config.ur_rtde {
            add(&[format!("tcp/{}:{}", ur.host, ur.port)], Way::Controller);
        }
        if let Some(commands) = &config.commands {
            add(&commands.listen, Way::Listen);
            add(&commands.connect, Way::Connect);
        }
    }
    if let Some(PublishSettings { config, .. }) = stage.settings.get() {
        if let Some(zenoh) = &config.zenoh {
            add(&zenoh.listen, Way::Listen);
            add(&zenoh.connect, Way::Connect);
        }
        if let Some(modbus) = &config.modbus {
            add(&[format!("tcp/{}", modbus.listen)], Way::Listen);
        }
    }
}

fn tried((of, endpoint, is): (String, String, Way)) -> Option<Endpoint> {
    let address = endpoint::address(&endpoint)?;
    let tried = match is {
        Way::Listen => endpoint::is_free(address),
        Way::Connect | Way::Controller => endpoint::answers(address),
    };
    Some(Endpoint {
        of,
        is,
        possible: tried.map_err(|error| error.to_string()),
        at: endpoint,
    })
}
