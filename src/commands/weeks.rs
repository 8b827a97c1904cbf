//! `tauscope weeks`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::Context as _;
use tauscope_archive::whole_file::{self, Existing};
use tauscope_fleet::physics::{self, CellPhysics};
use tauscope_fleet::store::{self, KEPT_NS, Note, Store, StoreError};
use tauscope_fleet::web::week_page;

use crate::existing::Force;
use crate::exit::{Exit, Failure};
use crate::interrupt;
use crate::output::Output;

const NS_A_DAY: i64 = 86_400_000_000_000;

/// Report changes of the arms over weeks, from the tables of `tauscope physics`.
///
/// Without --out: a line for each finding. A hundred unchanged cells cause one false finding in about ten years.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder with the tables of all cells.
    history: PathBuf,
    /// Only this cell. May be repeated.
    #[arg(long, value_name = "NAME")]
    cell: Vec<String>,
    /// Write a page for each cell here: `CELL.html`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// The store of the fleet host, whose maintenance notes start new baselines.
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Print series and findings of all cells as one JSON document.
    #[arg(long)]
    json: bool,
}

/// Reads the tables and reports the changes.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let notes = notes(args)?;
    let of_cell = |cell: &str| notes.get(cell).map_or(&[][..], Vec::as_slice);
    let baselines = |cell: &str| store::baselines(of_cell(cell));
    let now_ns = jiff::Timestamp::now().as_nanosecond();
    let now_ns = i64::try_from(now_ns).unwrap_or(i64::MAX);
    let since_day = ((now_ns - KEPT_NS) / NS_A_DAY) as f64;
    let read = physics::read(&args.history, since_day, &baselines);
    let (mut cells, unread) = read.map_err(|error| Failure::rejected(error.to_string()))?;
    for error in &unread {
        out.say(&format!("warning: {error}"));
    }
    let is_known = |name: &&String| cells.iter().any(|cell| cell.cell == **name);
    if let Some(missing) = args.cell.iter().find(|name| !is_known(name)) {
        let title = format!("{} has no cell `{missing}`", args.history.display());
        return Err(Failure::rejected(title));
    }
    cells.retain(|cell| args.cell.is_empty() || args.cell.contains(&cell.cell));
    if let Some(folder) = &args.out {
        let path = |cell: &CellPhysics| folder.join(format!("{}.html", cell.cell));
        args.force.check(cells.iter().map(path))?;
        std::fs::create_dir_all(folder).map_err(|error| {
            Failure::rejected(format!("cannot make {}: {error}", folder.display()))
        })?;
        let _hold = interrupt::hold();
        for cell in &cells {
            let page = week_page(cell, of_cell(&cell.cell), now_ns);
            whole_file::write(&path(cell), page.as_bytes(), Existing::Replace)
                .context("the page")?;
        }
    }
    if args.json {
        out.print(&serde_json::to_string_pretty(&cells).map_err(anyhow::Error::from)?)?;
    } else {
        out.print(&text(&cells, now_ns))?;
    }
    Ok(Exit::from_loss(!unread.is_empty()))
}

/// Returns the maintenance notes of all cells, newest first.
fn notes(args: &Args) -> Result<BTreeMap<String, Vec<Note>>, Failure> {
    let Some(path) = &args.store else {
        return Ok(BTreeMap::new());
    };
    if !path.exists() {
        let title = format!("there is no store {}", path.display());
        return Err(Failure::rejected(title));
    }
    let read = || {
        let store = Store::open(path)?;
        let cells = store.cells()?.into_iter();
        let notes = cells.map(|known| {
            let notes = store.notes(&known.cell, u32::MAX)?;
            Ok((known.cell, notes))
        });
        notes.collect::<Result<_, StoreError>>()
    };
    read().map_err(|error: StoreError| Failure::rejected(error.to_string()))
}

fn text(cells: &[CellPhysics], now_ns: i64) -> String {
    let mut text = String::new();
    for cell in cells {
        if let Some(days) = cell.stale_d(now_ns) {
            text += &format!(
                "{}: stale, the newest night was {days} days ago; what stands here is as of then\n",
                cell.cell
            );
        }
        for finding in &cell.findings {
            text += &format!("{}: {}\n", cell.cell, finding.sentence);
        }
        let outliers = cell.followed.iter().filter(|one| one.is_outlier);
        for one in outliers {
            let joint = one.series.joint.as_deref().unwrap_or("the arm");
            let (what, now, unit) = (one.series.quantity.words(), one.now, &one.unit);
            let peers = one.peers_median.unwrap_or(f64::NAN);
            text += &format!(
                "{}: {joint} is an outlier among its peers: {what} {now:.3} {unit}, theirs {peers:.3}.\n",
                cell.cell
            );
        }
    }
    let is_quiet = |cell: &&CellPhysics| cell.findings.is_empty() && cell.stale_d(now_ns).is_none();
    let quiet = cells.iter().filter(is_quiet).count();
    text + &format!("{quiet} of {} cells: nothing has changed\n", cells.len())
}
