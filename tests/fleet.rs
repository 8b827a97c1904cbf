//! `tauscope fleet` with running cells: a router, pipelines, the page over HTTP, a cell that is killed.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::live::{Live, signal};
use crate::common::{Out, bundled, tauscope, write};
use serde_json::Value;
use tauscope_bus::{ZenohEndpoints, ZenohRouter};

const PATIENCE: Duration = Duration::from_mins(1);

/// An address without a listener.
fn free() -> SocketAddr {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    free.local_addr().unwrap()
}

/// A router, and its endpoint.
fn router() -> (ZenohRouter, String) {
    let endpoint = format!("tcp/{}", free());
    let endpoints = ZenohEndpoints {
        listen: vec![endpoint.clone()],
        connect: Vec::new(),
    };
    (ZenohRouter::open(&endpoints).unwrap(), endpoint)
}

/// A cell that plays the bundled recording at half its speed and connects to `router`.
fn cell(folder: &Path, name: &str, router: &str) -> Live {
    let data = bundled();
    let data = data.display();
    let folder = folder.join(name);
    std::fs::create_dir(&folder).unwrap();
    write(
        &folder.join("pipeline.yaml"),
        &format!(
            "version: 1\ncells: {{{name}: {{robot: {data}/demo_arm.urdf}}}}\nstages:\n\
             - {{name: ingest, ingest: {{file: {{path: {data}/demo.mcap}}, rate: 0.5, \
             commands: {{connect: [{router}]}}}}}}\n\
             - {{name: twin, input: ingest, twin: {{model: {data}/demo.twin.yaml}}}}\n\
             - {{name: detect, input: twin, detect: {{twin_regression: {{}}}}}}\n\
             - {{name: record, inputs: [ingest, twin, detect], record: {{mcap: x.mcap, \
             around_alarms: {{rerun: \"alarm-{{n}}.rrd\"}}}}}}\n\
             - {{name: publish, inputs: [ingest, twin, detect], publish: {{latch: contact, stop_after_s: 5, \
             zenoh: {{connect: [{router}], json: false}}}}}}\n"
        ),
    );
    Live::start(&folder, &[])
}

/// A fleet host with a page; it is ended in any case.
struct Fleet {
    child: Child,
    address: SocketAddr,
    cookie: String,
}

impl Drop for Fleet {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Fleet {
    fn start(folder: &Path, router: &str, users: &Path) -> Self {
        Self::start_as(tauscope(), folder, router, users)
    }

    /// Starts it by a command with its own environment.
    fn start_as(mut command: Command, folder: &Path, router: &str, users: &Path) -> Self {
        command
            .current_dir(folder)
            .args(["fleet", "--serve", "127.0.0.1:0", "--expect", "paint"])
            .args(["--connect", router, "--users"])
            .arg(users);
        let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let at = lines.find_map(|line| {
            let line = line.unwrap();
            let at = line
                .strip_prefix("the wall is at http://")?
                .strip_suffix('/')?;
            Some(at.parse().unwrap())
        });
        std::thread::spawn(move || lines.map_while(Result::ok).for_each(drop));
        Self {
            child,
            address: at.unwrap(),
            cookie: String::new(),
        }
    }

    /// Sends a request; returns head and body of the answer.
    fn ask(&self, method: &str, path: &str, headers: &str, form: &str) -> (String, String) {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let kind = "Content-Type: application/x-www-form-urlencoded";
        write!(
            stream,
            "{method} {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\nCookie: {}\r\n{headers}{kind}\r\n\
             Content-Length: {}\r\n\r\n{form}",
            self.address,
            self.cookie,
            form.len()
        )
        .unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        let (head, body) = text.split_once("\r\n\r\n").unwrap();
        (head.to_owned(), body.to_owned())
    }

    fn get(&self, path: &str) -> String {
        let (head, body) = self.ask("GET", path, "", "");
        assert!(head.starts_with("HTTP/1.1 200"), "{path}: {head}");
        body
    }

    /// Status code of the answer to a form.
    fn post(&self, path: &str, headers: &str, form: &str) -> (u16, String) {
        let (head, _) = self.ask("POST", path, headers, form);
        (head[9..12].parse().unwrap(), head)
    }

    fn cell(&self, name: &str) -> Value {
        let state: Value = serde_json::from_str(&self.get("/fleet.json")).unwrap();
        let cells = state["cells"].as_array().unwrap();
        let cell = cells.iter().find(|cell| cell["cell"] == name);
        cell.cloned().unwrap_or(Value::Null)
    }

    /// Waits until a cell satisfies `wanted`; returns the time this took.
    fn wait(&self, name: &str, what: &str, wanted: impl Fn(&Value) -> bool) -> Duration {
        let begin = Instant::now();
        loop {
            let cell = self.cell(name);
            if wanted(&cell) {
                return begin.elapsed();
            }
            assert!(begin.elapsed() < PATIENCE, "{name} not {what}: {cell:#}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// First events of the wall, up to one that contains `wanted`.
    fn follow(&self, wanted: &str) -> String {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        write!(
            stream,
            "GET /events HTTP/1.1\r\nHost: {}\r\n\r\n",
            self.address
        )
        .unwrap();
        let mut heard = String::new();
        let mut lines = BufReader::new(stream).lines();
        while !heard.contains(wanted) {
            heard += &lines.next().unwrap().unwrap();
            heard.push('\n');
        }
        heard
    }
}

#[test]
fn cells_that_run_are_seen_acknowledged_from_the_page_and_missed_when_they_are_killed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (_router, endpoint) = router();
    let users = folder.join("users");
    let made = [
        "fleet",
        "--users",
        users.to_str().unwrap(),
        "--add-user",
        "anna",
    ];
    let made = Out::answer(made);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let token = made.stdout.trim();

    let press = cell(folder, "press", &endpoint);
    let weld = cell(folder, "weld", &endpoint);
    let mut fleet = Fleet::start(folder, &endpoint, &users);
    assert_eq!(fleet.cell("paint")["state"], "never_seen");
    let lives = |cell: &Value| cell["status"]["residual"]["joints"].is_array();
    fleet.wait("weld", "there", lives);
    fleet.wait("press", "stopped by its latch", |cell| {
        cell["state"] == "stopped"
    });

    let page = fleet.get("/");
    for part in [
        "stopped by latch",
        "never seen",
        "href=\"/cells/weld\"",
        "at link",
    ] {
        assert!(page.contains(part), "{part}: {page}");
    }
    let events = fleet.follow("weld");
    assert!(events.contains("event: wall"), "{events}");
    assert!(
        events.contains("content-security-policy: default-src 'none'"),
        "{events}"
    );
    let metrics = fleet.get("/metrics");
    assert!(
        metrics.contains("tauscope_fleet_cell_state{cell=\"press\",state=\"stopped\"} 1"),
        "{metrics}"
    );
    assert!(fleet.get("/healthz").starts_with("ok"));
    assert_eq!(fleet.ask("GET", "/cells/nobody", "", "").0[9..12], *"404");

    // Another fleet host that starts now also knows the time of the latch.
    let other = folder.join("other");
    std::fs::create_dir(&other).unwrap();
    let other = Fleet::start(&other, &endpoint, &users);
    let since = |cell: &Value| cell["latched_since_ns"].as_i64();
    other.wait("press", "latched", |cell| since(cell).is_some());
    let apart_ns = since(&other.cell("press")).unwrap() - since(&fleet.cell("press")).unwrap();
    // It begins with the status from up to a second ago, which the cell's cache returns.
    assert!(apart_ns.abs() < 2_000_000_000, "{apart_ns}");
    drop(other);

    acknowledge(&mut fleet, token);
    fleet.wait("press", "acknowledged by anna", |cell| {
        cell["status"]["last_contact"]["acknowledged_by"] == "anna"
    });
    let page = fleet.get("/cells/press");
    for part in [
        "Contacts",
        "x.mcap",
        "alarm-*.rrd",
        "joint7",
        "Acknowledge</button>",
        "acknowledged by anna",
    ] {
        assert!(page.contains(part), "{part}: {page}");
    }
    assert!(fleet.get("/incidents").contains("at link"));
    label(&fleet, "hit <the> fixture");

    // If two cells have the same name, neither accepts a command.
    let second = folder.join("second");
    std::fs::create_dir(&second).unwrap();
    let second = cell(&second, "weld", &endpoint);
    fleet.wait("weld", "there twice", |cell| cell["state"] == "unknown");
    let form = own_form(&fleet, "/cells/press");
    assert_eq!(fleet.post("/cells/weld/acknowledge", "", &form).0, 303);
    let page = fleet.get("/cells/weld");
    assert!(
        page.contains("two publishers have this name, and both"),
        "{page}"
    );
    signal(second.id(), "KILL");
    fleet.wait("weld", "there once", |cell| cell["state"] != "unknown");

    signal(weld.id(), "KILL");
    let known = fleet.wait("weld", "missed", |cell| cell["state"] == "stale");
    // The cell is known as lost from its token; the missing status alone would take 3.5 s.
    assert_eq!(fleet.cell("weld")["why"], "token");
    assert!(known < Duration::from_secs(3), "{known:?}");

    // A normal end of a cell is not a failure.
    signal(press.id(), "INT");
    fleet.wait("press", "ended", |cell| cell["state"] == "ended");
    signal(fleet.child.id(), "INT");
    assert!(fleet.child.wait().unwrap().success());
}

#[test]
fn the_clock_of_a_cell_is_measured_and_told_of_where_it_is_off() {
    let test = "the_clock_of_a_cell_is_measured_and_told_of_where_it_is_off";
    let libraries = ["x86_64", "aarch64"]
        .map(|machine| format!("/usr/lib/{machine}-linux-gnu/faketime/libfaketime.so.1"));
    let shifts = libraries.iter().find(|path| Path::new(path).exists());
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (_router, endpoint) = router();
    let users = folder.join("users");
    write(&users, "");
    let _cell = cell(folder, "press", &endpoint);
    let measured = |fleet: &Fleet, ahead_ms: f64| {
        fleet.wait("press", "measured", |cell| {
            cell["clock_ahead_ms"].is_number()
        });
        let cell = fleet.cell("press");
        let error_ms = cell["clock_ahead_ms"].as_f64().unwrap() - ahead_ms;
        let most_ms = cell["clock_uncertainty_ms"].as_f64().unwrap();
        assert!(error_ms.abs() <= most_ms, "{cell:#}");
        cell["clock_is_off"].clone()
    };
    // The cell has the clock of this computer.
    let fleet = Fleet::start(folder, &endpoint, &users);
    assert_eq!(measured(&fleet, 0.0), false);
    drop(fleet);

    let Some(library) = shifts else {
        return crate::common::skipped(test, "a clock is shifted by libfaketime, which is absent");
    };
    let mut command = tauscope();
    command
        .env("LD_PRELOAD", library)
        .env("FAKETIME", "-340")
        .env("DONT_FAKE_MONOTONIC", "1");
    let fleet = Fleet::start_as(command, folder, &endpoint, &users);
    assert_eq!(measured(&fleet, 340_000.0), true);
    let page = fleet.get("/");
    assert!(page.contains("340 s ahead"), "{page}");
    let metrics = fleet.get("/metrics");
    let metric = "clock_ahead_seconds{cell=\"press\"} 3";
    assert!(metrics.contains(metric), "{metrics}");
}

/// Labels at the press: the label is shown with its contact and incident, and with user and time.
fn label(fleet: &Fleet, text: &str) {
    let form = own_form(fleet, "/cells/press");
    let text = text
        .replace('<', "%3C")
        .replace('>', "%3E")
        .replace(' ', "+");
    let (code, head) = fleet.post("/cells/press/label", "", &format!("{form}&text={text}"));
    assert_eq!(code, 303, "{head}");
    for path in ["/cells/press", "/incidents"] {
        let begin = Instant::now();
        let shown = loop {
            let page = fleet.get(path);
            let with = page.split("<div class=\"label\">").nth(1);
            if let Some(label) = with.and_then(|label| label.split("</div>").next()) {
                break label.to_owned();
            }
            assert!(begin.elapsed() < PATIENCE, "{path}: {page}");
            std::thread::sleep(Duration::from_millis(20));
        };
        let is_whole = shown.contains("hit &lt;the&gt; fixture") && shown.contains("anna, <time");
        assert!(is_whole, "{path}: {shown}");
    }
}

/// Secret that proves that a form comes from the user's own page.
fn own_form(fleet: &Fleet, page: &str) -> String {
    let page = fleet.get(page);
    let secret = page.split("name=\"csrf\" value=\"").nth(1).unwrap();
    format!("csrf={}", secret.split('"').next().unwrap())
}

/// Acknowledges at the press; forms from elsewhere are refused.
fn acknowledge(fleet: &mut Fleet, token: &str) {
    let to = "/cells/press/acknowledge";
    assert_eq!(fleet.post(to, "", "csrf=").0, 403);
    assert_eq!(fleet.post("/login", "", "token=1234").0, 403);
    let (code, head) = fleet.post("/login", "", &format!("token={token}"));
    assert_eq!(code, 303, "{head}");
    let cookie = head
        .lines()
        .find_map(|line| line.strip_prefix("set-cookie: "));
    let pair = cookie.unwrap().split(';').next();
    fleet.cookie = pair.unwrap_or_default().into();
    let form = own_form(fleet, "/cells/press");
    let elsewhere = "Origin: http://elsewhere.example\r\n";
    assert_eq!(fleet.post(to, elsewhere, &form).0, 403);
    assert_eq!(fleet.post(to, "", "csrf=00").0, 403);
    let (code, head) = fleet.post(to, "", &form);
    assert_eq!(code, 303, "{head}");
    assert!(
        fleet
            .get("/cells/press")
            .contains("Done: the cell has taken it")
    );
}

#[test]
fn the_document_says_what_is_missing_and_so_does_the_exit_code() {
    let (_router, endpoint) = router();
    let out = Out::answer([
        "fleet",
        "--json",
        "--connect",
        &endpoint,
        "--expect",
        "paint",
    ]);
    assert_eq!(out.code, 3, "{}", out.stderr);
    let state: Value = serde_json::from_str(&out.stdout).unwrap();
    assert_eq!(state["cells"][0]["state"], "never_seen");
    assert_eq!(state["sessions_reached"], 1);
    // The router need not exist yet.
    let nobody = format!("tcp/{}", free());
    let out = Out::answer(["fleet", "--json", "--connect", &nobody]);
    assert_eq!(out.code, 1, "{}", out.stderr);
    let out = Out::answer(["fleet", "--json", "--connect", "garbage"]);
    assert_eq!(out.code, 2, "{}", out.stderr);
    let out = Out::answer(["fleet", "--serve", "--users", "/nowhere/users"]);
    assert_eq!(out.code, 2, "{}", out.stderr);
}
