//! `tauscope info`.

use std::path::PathBuf;

use serde::Serialize;
use tauscope_archive::{Info, Recording};
use tauscope_session::{Finding, Publisher, SessionError, Survey};

use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Summarise a recording: topics and rates, publishers, gaps, motion and anomalies of the joints, damage.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// An MCAP file, a rosbag2 folder, a `.db3`, a `.bag` of ROS 1, a table (`.csv`), or an episode of a LeRobot data
    /// set (`DATASET/episode_000003`).
    recording: PathBuf,
    /// Print the summary as JSON.
    #[arg(long)]
    json: bool,
}

/// The summary of a recording, as printed with `--json`.
#[derive(Debug, Serialize)]
struct Printed {
    #[serde(flatten)]
    info: Info,
    /// Publishers and findings, by topic of joint states.
    joint_states: Vec<Topic>,
}

/// Publishers and findings of a topic of joint states.
#[derive(Debug, Serialize)]
struct Topic {
    name: String,
    publishers: Vec<Publisher>,
    findings: Vec<Finding>,
    /// Each finding as a sentence.
    sentences: Vec<String>,
}

/// Reads the recording and prints the summary.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let rejected = |error: SessionError| Failure::rejected(error.to_string());
    let recording = tauscope_session::open(&args.recording).map_err(|it| rejected(it.into()))?;
    let info = Info::read(&recording).map_err(|error| rejected(error.into()))?;
    let joint_states = joint_states(&recording).map_err(rejected)?;
    let lost = info.has_lost_data();
    let printed = Printed { info, joint_states };
    let text = if args.json {
        serde_json::to_string_pretty(&printed).map_err(anyhow::Error::from)?
    } else {
        text(&printed)
    };
    out.print(&text)?;
    Ok(Exit::from_loss(lost))
}

fn joint_states(recording: &Recording) -> Result<Vec<Topic>, SessionError> {
    let topics = recording.topics().iter();
    let topics = topics.filter(|it| it.joint_state_type().is_some() && it.message_count > 0);
    let each = topics.map(|topic| {
        let survey = Survey::of(recording, &topic.name)?;
        let sentences = survey.findings.iter().map(ToString::to_string);
        Ok(Topic {
            name: topic.name.clone(),
            sentences: sentences.collect(),
            publishers: survey.publishers,
            findings: survey.findings,
        })
    });
    each.collect()
}

/// Formats the recording, then publishers and findings of each topic of joint states.
fn text(printed: &Printed) -> String {
    let mut text = printed.info.to_string();
    for topic in &printed.joint_states {
        let on = if printed.info.kind.is_table() {
            String::new()
        } else {
            format!(" on {}", topic.name)
        };
        if topic.publishers.len() > 1 {
            text += &format!("{} publishers{on}:\n", topic.publishers.len());
            for publisher in &topic.publishers {
                text += &format!("  {publisher}\n");
            }
        }
        // The summary of the topic already counts the messages that cannot be decoded.
        let findings = topic.findings.iter();
        let findings = findings.filter(|it| !matches!(it, Finding::Undecodable { .. }));
        let findings: Vec<String> = findings.map(|finding| format!("  {finding}.\n")).collect();
        if !findings.is_empty() {
            text += &format!("findings{on}:\n{}", findings.concat());
        }
    }
    text
}
