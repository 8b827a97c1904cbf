//! `tauscope diff`.

mod page;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use comfy_table::{CellAlignment, Table, presets};
use tauscope_archive::whole_file::{self, Existing};
use tauscope_pipeline::pipeline::Pipeline;
use tauscope_pipeline::replay::TwinChoice;
use tauscope_pipeline::report::Problem;
use tauscope_pipeline::results::{
    Ambiguous, Comparison, Counts, Difference, Results, compare, parquet_files, read_results,
};

use super::replay::archive::{self, Job};
use crate::existing::Force;
use crate::exit::{Exit, Failure};
use crate::output::Output;
use crate::progress::Quiet;

/// Maximum number of differences shown on a terminal; `--json` and `--html` have all.
const MAX_SHOWN: usize = 40;

/// Columns of the table of differences; the first one, without a title, is the kind of change.
const COLUMNS: [&str; 7] = [
    "",
    "cell",
    "recording",
    "seconds",
    "link",
    "joints",
    "moved",
];

/// Compare two results over the same recordings: which events appeared, vanished and moved, by cell, link and joint.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The first result: a folder of `replay --manifest`, or a pipeline file to replay --manifest with.
    a: PathBuf,
    /// The second result, or pipeline file.
    b: PathBuf,
    /// For pipeline files: the recordings.
    #[arg(long, value_name = "FILE", requires = "out")]
    manifest: Option<PathBuf>,
    /// For pipeline files: the folder for their results, in `a` and `b`. Existing results are reused.
    #[arg(long, value_name = "DIR", requires = "manifest")]
    out: Option<PathBuf>,
    /// For pipeline files: number of recordings replayed in parallel.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
    /// Largest time between two alarms, one from each result, that are treated as the same event [s].
    #[arg(long, value_name = "SECONDS", default_value_t = 0.1, value_parser = tolerance)]
    tolerance_s: f64,
    /// Also write the comparison as an HTML page.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Print the comparison as JSON.
    #[arg(long)]
    json: bool,
}

fn tolerance(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "no number".to_owned())?;
    if (0.0..=3600.0).contains(&seconds) {
        Ok(seconds)
    } else {
        Err("not from 0 to 3600 s".to_owned())
    }
}

/// Compares the two results and prints the differences.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let inputs = [&args.a, &args.b].into_iter().chain(&args.manifest);
    args.force.check_beside(args.html.clone(), inputs)?;
    let note = same(&args.a, &args.b);
    if let Some(note) = &note {
        out.say(&format!("warning: {note}"));
    }
    let (a, lost_a) = result(args, &args.a, "a", out)?;
    let (b, lost_b) = result(args, &args.b, "b", out)?;
    let ambiguous = |error: Ambiguous| ambiguous(args, &error, note.as_deref());
    let comparison = compare(&a, &b, args.tolerance_s).map_err(ambiguous)?;
    if comparison.recordings == 0 {
        let help = "both must be results over the same recordings";
        let problem = Problem::new("the two results have no recording in common").help(help);
        return Err(Failure::Rejected(problem.into()));
    }
    if let Some(html) = &args.html {
        let page = page::page(&comparison, &args.a, &args.b, note.as_deref());
        whole_file::write(html, page, Existing::Replace)
            .with_context(|| html.display().to_string())?;
    }
    if args.json {
        out.print(&serde_json::to_string_pretty(&comparison).context("the comparison")?)?;
    } else {
        out.print(&text(&comparison))?;
    }
    Ok(lost_a.and(lost_b))
}

/// Returns a note if both results are the same file or folder, so that nothing can differ.
fn same(a: &Path, b: &Path) -> Option<String> {
    let real = |path: &Path| path.canonicalize().ok();
    let is_same = real(a).is_some_and(|real_a| real(b) == Some(real_a));
    let name = a.display();
    is_same.then(|| {
        format!("A and B are both {name}: it is compared with itself, so that nothing can differ; name another B")
    })
}

/// Explains why a folder is not the result of one pipeline, and suggests folders within it that are.
fn ambiguous(args: &Args, error: &Ambiguous, note: Option<&str>) -> Failure {
    let folder = if error.result == "A" {
        &args.a
    } else {
        &args.b
    };
    let files = parquet_files(folder).unwrap_or_default();
    let own = |file: &PathBuf| {
        let is_cell = |path: &&Path| {
            let name = path.file_name().unwrap_or_default();
            name.to_string_lossy().starts_with("cell=")
        };
        let cell = file.ancestors().find(is_cell)?;
        Some(cell.parent()?.display().to_string())
    };
    let mut folders: Vec<String> = files.iter().filter_map(own).collect();
    folders.dedup();
    let title = format!("{error} ({} is {})", error.result, folder.display());
    let help = match (&folders[..], note) {
        ([first, second, ..], _) => {
            format!("it holds several results; perhaps: tauscope diff {first} {second}")
        }
        (_, Some(note)) => note.to_owned(),
        _ => "give the folder of one pipeline".to_owned(),
    };
    Failure::Rejected(Problem::new(title).help(&help).into())
}

/// Reads a result; for a pipeline file, first makes it by a replay.
fn result(
    args: &Args,
    given: &Path,
    name: &str,
    out: &mut Output,
) -> Result<(Results, Exit), Failure> {
    let is_pipeline = given
        .extension()
        .is_some_and(|ending| ending == "yaml" || ending == "yml");
    let (folder, exit) = match (&args.manifest, &args.out) {
        (Some(manifest), Some(results)) if is_pipeline => {
            let folder = results.join(name);
            let job = Job {
                manifest,
                shard: None,
                out: &folder.to_string_lossy(),
                jobs: args.jobs,
                twin: TwinChoice::Recompute,
                with_scores: false,
                json: false,
                show: Quiet::default().show(out),
            };
            let mut told = Output::Memory(String::new(), String::new());
            let replayed = archive::run(&job, &Pipeline::load_to_replay(given)?, &mut told);
            if let Output::Memory(done, said) = told {
                out.say(format!("{}: {done}{said}", given.display()).trim_end());
            }
            (folder, replayed?)
        }
        _ if is_pipeline => {
            let title = format!("{} is a pipeline file", given.display());
            let help =
                "say which recordings to replay with --manifest, and where results go with --out";
            return Err(Failure::Rejected(Problem::new(title).help(help).into()));
        }
        _ => (given.to_owned(), Exit::Done),
    };
    let read = parquet_files(&folder).and_then(|files| read_results(&files));
    let results = read.map_err(|error| Failure::rejected(error.to_string()))?;
    if results.recordings.is_empty() && exit == Exit::Done {
        let title = format!("there is no result of a recording in {}", folder.display());
        let help = "`tauscope replay --manifest` makes them";
        return Err(Failure::Rejected(Problem::new(title).help(help).into()));
    }
    Ok((results, exit))
}

/// Formats the comparison for a terminal.
fn text(comparison: &Comparison) -> String {
    let mut text = format!("{}\n", headline(comparison));
    for (name, only) in [("A", &comparison.only_in_a), ("B", &comparison.only_in_b)] {
        if !only.is_empty() {
            let _ = writeln!(text, "only in {name}: {} recordings", only.len());
        }
    }
    if comparison.differences.is_empty() {
        return text;
    }
    let mut counts = table(["", "appeared", "vanished", "moved"]);
    for (place, of) in places(comparison) {
        let numbers = [of.appeared, of.vanished, of.moved].map(|n| n.to_string());
        counts.add_row(std::iter::once(place).chain(numbers));
    }
    for column in counts.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let mut list = table(COLUMNS);
    for difference in comparison.differences.iter().take(MAX_SHOWN) {
        list.add_row(row(difference));
    }
    let _ = writeln!(text, "\n{counts}\n\n{list}");
    let more = comparison.differences.len().saturating_sub(MAX_SHOWN);
    if more > 0 {
        let _ = writeln!(text, "and {more} more: --json or --html has all");
    }
    text
}

fn table<const N: usize>(header: [&str; N]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING).set_header(header);
    table
}

/// Returns the numbers of recordings, events and changes as a sentence.
fn headline(comparison: &Comparison) -> String {
    let mut total = Counts::default();
    for counts in comparison.cells.values() {
        total.appeared += counts.appeared;
        total.vanished += counts.vanished;
        total.moved += counts.moved;
    }
    format!(
        "{} recordings, {} events in A, {} in B: {} the same, {} appeared, {} vanished, {} moved",
        comparison.recordings,
        comparison.events_a,
        comparison.events_b,
        comparison.same,
        total.appeared,
        total.vanished,
        total.moved
    )
}

/// Returns the counts by cell, and within each cell by link and joint.
fn places(comparison: &Comparison) -> Vec<(String, Counts)> {
    let mut places = Vec::new();
    for (cell, &counts) in &comparison.cells {
        places.push((format!("cell {cell}"), counts));
        for (kind, within) in [("link", &comparison.links), ("joint", &comparison.joints)] {
            for (name, &counts) in within.get(cell).into_iter().flatten() {
                let name = if name.is_empty() { "unnamed" } else { name };
                places.push((format!("  {kind} {name}"), counts));
            }
        }
    }
    places
}

/// Returns a difference as a row of the table.
fn row(difference: &Difference) -> [String; 7] {
    let both = [&difference.a, &difference.b];
    let told = || both.into_iter().flatten();
    let from_s = told().map(|t| t.t_s).fold(f64::INFINITY, f64::min);
    let to_s = told().map(|t| t.t_off_s).fold(0.0, f64::max);
    [
        difference.change.as_str().to_owned(),
        difference.cell.clone(),
        difference.recording.clone(),
        format!("{from_s:.3} to {to_s:.3}"),
        difference.link().to_owned(),
        difference.joints().join(" "),
        difference.what_moved().join(", "),
    ]
}
