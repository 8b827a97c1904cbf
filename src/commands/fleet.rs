//! `tauscope fleet`.

use std::collections::BTreeMap;
use std::io::IsTerminal as _;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tauscope_bus::ZenohEndpoints;
use tauscope_fleet::wall::{Snapshot, State};
use tauscope_fleet::web::{Origin, Server, Users};
use tauscope_fleet::{FleetError, Hub, Options, show};

use crate::exit::{Exit, Failure};
use crate::interrupt;
use crate::output::Output;

/// Default endpoint of the router.
const ROUTER: &str = "tcp/127.0.0.1:7447";
/// Default address of the page.
const PAGE: &str = "127.0.0.1:7460";
/// Default file for incidents and history of a served page.
const STORE: &str = "fleet.sqlite";
/// Time that `--json` waits for the cells' status.
/// Resolution: a cell sends its status once per second.
const GATHER: Duration = Duration::from_secs(3);
/// Refresh interval of the terminal.
const SHOW: Duration = Duration::from_secs(1);
/// Poll interval for an interrupt.
const LOOK: Duration = Duration::from_millis(100);

/// Show all cells: which are running, stopped or silent, and their contacts.
///
/// Without options: a table that follows the cells or, in a pipe, a line for each change, until Ctrl-C.
///
/// `--json` ends with exit code 0 if every cell is connected, 3 if a cell is stale, unknown, never seen or has lost
/// samples, and 1 if neither a router nor a cell is reached.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Serve the page at this address; without an address, at 127.0.0.1:7460. It is plain HTTP.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = PAGE)]
    serve: Option<SocketAddr>,
    /// Origin under which a proxy serves the page, such as `https://fleet.plant`: its forms are accepted. May be
    /// repeated.
    #[arg(long, value_name = "ORIGIN", requires = "serve")]
    origin: Vec<Origin>,
    /// Print the state of all cells after 3 s as one JSON document.
    #[arg(long, conflicts_with = "serve")]
    json: bool,
    /// Endpoint of a router; by default tcp/127.0.0.1:7447, unless `--listen` is given. May be repeated.
    #[arg(long, value_name = "ENDPOINT")]
    connect: Vec<String>,
    /// Endpoint on which this host itself accepts connections of cells. May be repeated.
    #[arg(long, value_name = "ENDPOINT")]
    listen: Vec<String>,
    /// A cell that is expected, and shown even before it connects. May be repeated.
    #[arg(long, value_name = "CELL")]
    expect: Vec<String>,
    /// File of the users who may acknowledge, mute, label and note on the page; without it the page is read-only.
    #[arg(long, value_name = "FILE")]
    users: Option<PathBuf>,
    /// Add a user to the file of `--users`, print the token, and exit.
    #[arg(long, value_name = "NAME", requires = "users")]
    add_user: Option<String>,
    /// SQLite file for contacts, incidents and history; with `--serve` by default fleet.sqlite.
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    /// Folder of the nightly tables of `tauscope physics`: the page shows each arm's physics over weeks.
    #[arg(long, value_name = "DIR")]
    physics: Option<PathBuf>,
    /// Exit after this time.
    #[arg(long, value_name = "SECONDS")]
    seconds: Option<u64>,
}

/// Shows all cells.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    if let (Some(name), Some(file)) = (&args.add_user, &args.users) {
        let made = Users::add(file, name).map_err(|error| Failure::rejected(error.to_string()))?;
        out.print(&format!("{}\n", made.token))?;
        let known = format!(
            "the token of `{}`; it is shown once and kept nowhere",
            made.name
        );
        out.say(&known);
        return Ok(Exit::Done);
    }
    let users = args.users.as_deref().map_or(Ok(Users::none()), Users::read);
    let users = users.map_err(|error| Failure::rejected(error.to_string()))?;
    let _hold = interrupt::hold();
    let hub = Hub::start(&options(args)).map_err(failed)?;
    let hub = Arc::new(hub);
    if args.json {
        return json(&hub, out);
    }
    let _server = match args.serve {
        Some(address) => Some(serve(args, &hub, address, users, out)?),
        None => None,
    };
    follow(args, &hub, out)?;
    Ok(Exit::Done)
}

fn options(args: &Args) -> Options {
    let mut connect = args.connect.clone();
    if connect.is_empty() && args.listen.is_empty() {
        connect.push(ROUTER.to_owned());
    }
    let by_default = args.serve.map(|_| PathBuf::from(STORE));
    Options {
        endpoints: ZenohEndpoints {
            listen: args.listen.clone(),
            connect,
        },
        expected: args.expect.clone(),
        store: args.store.clone().or(by_default),
        physics: args.physics.clone(),
    }
}

/// Treats a wrong endpoint or store as a wrong argument: the user gave it.
fn failed(error: FleetError) -> Failure {
    match error {
        FleetError::Session(_) | FleetError::Store(_) => Failure::rejected(error.to_string()),
        error => Failure::Failed(error.into()),
    }
}

fn serve(
    args: &Args,
    hub: &Arc<Hub>,
    address: SocketAddr,
    users: Users,
    out: &mut Output,
) -> Result<Server, Failure> {
    if args.users.is_some() && users.is_empty() {
        out.say("note: there are no users yet; `--add-user NAME` makes one");
    }
    let server = Server::start(hub.clone(), address, users, args.origin.clone())
        .map_err(anyhow::Error::from)?;
    out.say(&format!("the wall is at http://{}/", server.address()));
    if !server.address().ip().is_loopback() {
        out.say(
            "warning: other computers reach this page, over plain HTTP: tokens can be read on the way. Put a proxy with \
             TLS before it (docs/fleet.md)",
        );
    }
    Ok(server)
}

/// Prints the state of all cells as JSON, after waiting for their status.
fn json(hub: &Hub, out: &mut Output) -> Result<Exit, Failure> {
    wait(GATHER);
    let snapshot = hub.snapshot();
    out.print(&serde_json::to_string_pretty(&*snapshot).map_err(anyhow::Error::from)?)?;
    Ok(judge(&snapshot))
}

fn judge(snapshot: &Snapshot) -> Exit {
    let is_missing = |state| {
        matches!(
            state,
            State::Stale { .. } | State::Unknown { .. } | State::NeverSeen
        )
    };
    let mut cells = snapshot.cells.iter();
    if snapshot.sessions_reached == 0 {
        Exit::Failed
    } else {
        Exit::from_loss(cells.any(|view| is_missing(view.state) || view.lost_samples > 0))
    }
}

/// Shows the cells until an interrupt or the end of `--seconds`: a table on a terminal, lines in a pipe.
fn follow(args: &Args, hub: &Hub, out: &mut Output) -> Result<(), Failure> {
    let redraws = matches!(out, Output::Terminal) && std::io::stdout().is_terminal();
    let end = args
        .seconds
        .map(|s| Instant::now() + Duration::from_secs(s));
    let mut told: BTreeMap<String, State> = BTreeMap::new();
    while !interrupt::is_asked() && end.is_none_or(|end| Instant::now() < end) {
        let snapshot = hub.snapshot();
        if redraws {
            // Cursor to the top left corner, then clear the screen below it.
            out.print(&format!("\x1b[H\x1b[J{}", show::table(&snapshot)))?;
        } else {
            lines(&snapshot, &mut told, out)?;
        }
        let left = end.map_or(SHOW, |end| end.saturating_duration_since(Instant::now()));
        wait(SHOW.min(left));
    }
    Ok(())
}

fn lines(
    snapshot: &Snapshot,
    told: &mut BTreeMap<String, State>,
    out: &mut Output,
) -> Result<(), Failure> {
    for view in &snapshot.cells {
        let before = told.insert(view.cell.clone(), view.state);
        if before.is_none_or(|before| !before.same_as(view.state)) {
            out.print(&show::line(view, snapshot.now_ns))?;
        }
    }
    Ok(())
}

fn wait(time: Duration) {
    let end = Instant::now() + time;
    while !interrupt::is_asked() && Instant::now() < end {
        std::thread::sleep(LOOK.min(end.saturating_duration_since(Instant::now())));
    }
}
