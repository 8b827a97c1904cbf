//! `tauscope info`.

use std::path::PathBuf;

use tauscope_archive::{Info, Recording};

use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Say what is in a recording: its topics and rates, gaps, whose joints move and what is odd about them, damage.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// An MCAP file, a rosbag2 folder, a `.db3`, a `.bag` of ROS 1, a table (`.csv`), or an episode of a LeRobot data set
    /// (`DATASET/episode_000003`).
    recording: PathBuf,
    /// Machine-readable.
    #[arg(long)]
    json: bool,
}

/// Prints it.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let rejected = |error: tauscope_archive::ArchiveError| Failure::rejected(error.to_string());
    let recording = Recording::open(&args.recording).map_err(rejected)?;
    let info = Info::read(&recording).map_err(rejected)?;
    let text = if args.json {
        serde_json::to_string_pretty(&info).map_err(anyhow::Error::from)?
    } else {
        info.to_string()
    };
    out.print(&text)?;
    Ok(Exit::from_loss(info.has_lost_data()))
}
