//! `tauscope info`.

use std::fmt::Write as _;
use std::path::PathBuf;

use comfy_table::{Table, presets};
use serde::Serialize;
use tauscope_archive::ros::{self, Message as _};
use tauscope_archive::{Damage, Recording, RecordingKind, Topic};

use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Say what is in a recording: its topics, how long it is, whose joints move, what is damaged.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// An MCAP file, a rosbag2 folder, or a `.db3`.
    recording: PathBuf,
    /// Machine-readable.
    #[arg(long)]
    json: bool,
}

/// What is known of a recording.
#[derive(Debug, Serialize)]
struct Info<'a> {
    recording: String,
    kind: RecordingKind,
    /// Log time of the first and the last message \[s since the epoch\].
    start_s: Option<f64>,
    end_s: Option<f64>,
    duration_s: f64,
    messages: u64,
    topics: &'a [Topic],
    joint_states: Vec<Joints>,
    damage: &'a [Damage],
}

/// What the first message of a topic of joint states says.
#[derive(Debug, Serialize)]
struct Joints {
    topic: String,
    names: Vec<String>,
    position: bool,
    velocity: bool,
    effort: bool,
}

/// Prints it.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let recording =
        Recording::open(&args.recording).map_err(|error| Failure::rejected(error.to_string()))?;
    let seconds = |ns: i64| ns as f64 * 1e-9;
    let duration_ns = recording.end_ns().unwrap_or(0) - recording.start_ns().unwrap_or(0);
    let info = Info {
        recording: args.recording.display().to_string(),
        kind: recording.kind(),
        start_s: recording.start_ns().map(seconds),
        end_s: recording.end_ns().map(seconds),
        duration_s: seconds(duration_ns),
        messages: recording.message_count(),
        topics: recording.topics(),
        joint_states: joint_states(&recording),
        damage: recording.damage(),
    };
    let text = if args.json {
        serde_json::to_string_pretty(&info).map_err(anyhow::Error::from)?
    } else {
        words(&info)
    };
    out.print(&text)?;
    Ok(Exit::from_loss(info.damage.iter().any(Damage::loses_data)))
}

fn joint_states(recording: &Recording) -> Vec<Joints> {
    let topics = recording.topics().iter();
    let topics = topics.filter(|topic| topic.type_name == ros::JointState::TYPE);
    let first = |topic: &Topic| {
        let mut states = recording.joint_states(&topic.name).ok()?;
        let state = states.next_state()?.ok()?.message;
        Some(Joints {
            topic: topic.name.clone(),
            names: state.name.clone(),
            position: !state.position.is_empty(),
            velocity: !state.velocity.is_empty(),
            effort: !state.effort.is_empty(),
        })
    };
    topics.filter_map(first).collect()
}

fn words(info: &Info<'_>) -> String {
    let Info {
        recording,
        kind,
        duration_s,
        messages,
        ..
    } = info;
    let mut text = format!("{recording}: {kind}, {messages} messages in {duration_s:.3} s\n\n");
    let mut table = Table::new();
    table.load_preset(presets::UTF8_FULL_CONDENSED).set_header([
        "topic",
        "type",
        "messages",
        "per second",
    ]);
    for topic in info.topics {
        let rate = match topic.message_count {
            count if count > 1 && *duration_s > 0.0 => {
                format!("{:.1}", (count - 1) as f64 / duration_s)
            }
            _ => String::new(),
        };
        let count = topic.message_count.to_string();
        table.add_row([topic.name.clone(), topic.type_name.clone(), count, rate]);
    }
    let _ = writeln!(text, "{}", table.trim_fmt());
    for joints in &info.joint_states {
        let given = [
            (joints.position, "position"),
            (joints.velocity, "velocity"),
            (joints.effort, "effort"),
        ];
        let given: Vec<&str> = given
            .into_iter()
            .filter_map(|(is, name)| is.then_some(name))
            .collect();
        let (names, given) = (joints.names.join(", "), given.join(", "));
        let _ = write!(text, "\n{}: {names} with {given}", joints.topic);
    }
    for damage in info.damage {
        let _ = write!(text, "\ndamage: {damage}");
    }
    text
}
