//! `tauscope send`.

use std::path::PathBuf;
use std::time::Duration;

use tauscope_bus::ZenohEndpoints;
use tauscope_bus::command::{Answer, Request, ask};
use tauscope_pipeline::pipeline::PipelineFile;
use tauscope_pipeline::report::Problem;
use tauscope_pipeline::suggest;
use tauscope_pipeline::yaml;

use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Timeout of the answer. The pipeline itself refuses a command after 1 s if no sample takes it.
const PATIENCE: Duration = Duration::from_secs(5);

/// Send a command to a running pipeline: acknowledge an alarm, mute alarms, set the payload, label the archive.
///
/// The answer is the stamp of the first sample to which the command applies, or the reason for a refusal.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The command.
    #[command(subcommand)]
    verb: Verb,
    /// The cell, if the pipeline has several.
    #[arg(long, global = true, value_name = "NAME")]
    cell: Option<String>,
    /// The pipeline file, which has the endpoint for commands to its source.
    #[arg(
        long,
        global = true,
        value_name = "FILE",
        default_value = "pipeline.yaml"
    )]
    pipeline: PathBuf,
    /// Endpoint of the source, e.g. tcp/10.0.0.1:7448, in place of a pipeline file; requires `--cell`.
    #[arg(long, global = true, value_name = "ENDPOINT", requires = "cell")]
    connect: Option<String>,
    /// Print the answer as JSON.
    #[arg(long, global = true)]
    json: bool,
}

/// A command to a pipeline.
#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// Acknowledge the alarm: a latched collision is released once it has ended.
    Acknowledge,
    /// Keep alarms from raising a stop for this time, at most 60 s; 0 ends the mute.
    Mute {
        /// Duration, from the sample that takes the command [s].
        #[arg(allow_negative_numbers = true)]
        seconds: f64,
    },
    /// Set the payload from now on, as a point mass.
    Payload {
        /// Mass [kg]; 0 for none.
        #[arg(allow_negative_numbers = true)]
        mass_kg: f64,
        /// Centre of mass in the tool link's frame [m].
        #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
        com: Option<Vec<f64>>,
    },
    /// Restart the learning of detectors that learn while they run.
    Learn,
    /// Write a note into the archive.
    Label {
        /// Text of the note, at most 48 bytes.
        #[arg(required = true)]
        text: Vec<String>,
    },
}

impl Verb {
    fn request(&self) -> Request {
        match self {
            Self::Acknowledge => Request::Acknowledge,
            Self::Mute { seconds } => Request::Mute { seconds: *seconds },
            Self::Payload { mass_kg, com } => Request::Payload {
                mass_kg: *mass_kg,
                com_m: com
                    .as_ref()
                    .and_then(|com| com.as_slice().try_into().ok())
                    .unwrap_or_default(),
            },
            Self::Learn => Request::Learn,
            Self::Label { text } => Request::Label {
                text: text.join(" "),
            },
        }
    }
}

/// Sends it and prints the answer.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let request = args.verb.request();
    let command = request.command();
    let command = command.map_err(|refusal| Failure::rejected(refusal.to_string()))?;
    let (cell, endpoints) = match (&args.connect, &args.cell) {
        (Some(endpoint), Some(cell)) => {
            let connect = vec![endpoint.clone()];
            let listen = Vec::new();
            (cell.clone(), ZenohEndpoints { listen, connect })
        }
        _ => meeting_point(args)?,
    };
    let session = endpoints.session().map_err(anyhow::Error::from)?;
    let answer = ask(&session, &cell, &request, PATIENCE).map_err(anyhow::Error::from)?;
    if args.json {
        out.print(&serde_json::to_string(&answer).map_err(anyhow::Error::from)?)?;
    }
    match answer {
        Answer::Taken { stamp_ns } => {
            if !args.json {
                let stamp = format!(
                    "{}.{:09}",
                    stamp_ns / 1_000_000_000,
                    stamp_ns % 1_000_000_000
                );
                out.print(&format!(
                    "{cell}: {}: holds from the sample with the stamp {stamp} s",
                    command.in_words().unwrap_or_default()
                ))?;
            }
            Ok(Exit::Done)
        }
        Answer::Refused { reason } => Err(Failure::rejected(format!("{cell}: refused: {reason}"))),
    }
}

/// Returns the cell, and the endpoint for commands to its source, from the pipeline file.
fn meeting_point(args: &Args) -> Result<(String, ZenohEndpoints), Failure> {
    let file = yaml::load::<PipelineFile>(&args.pipeline)?.value;
    let names = || file.cells.keys().map(String::as_str);
    let cell = match (&args.cell, file.cells.len()) {
        (Some(cell), _) if !file.cells.contains_key(cell) => {
            let problem = Problem::new(format!("the pipeline has no cell `{cell}`"));
            let help = suggest::help(cell, "the cells are", names());
            return Err(Failure::Rejected(problem.maybe_help(help).into()));
        }
        (Some(cell), _) => cell.clone(),
        (None, 1) => names().next().unwrap_or_default().to_owned(),
        (None, _) => {
            let help = format!("give `--cell`, one of {}", suggest::list(names()));
            let problem = Problem::new("the pipeline has several cells: which one is meant?");
            return Err(Failure::Rejected(problem.help(help).into()));
        }
    };
    let in_cell = |of: &Option<String>| of.as_ref().is_none_or(|of| *of == cell);
    let endpoints = file
        .stages
        .iter()
        .filter(|stage| in_cell(&stage.cell))
        .find_map(|stage| stage.config::<tauscope_ingest::Config>()?.commands.as_ref());
    let Some(endpoints) = endpoints else {
        let problem = Problem::new(format!("the source of `{cell}` takes no commands"));
        let help = "give its `ingest` a place for them: `commands: {listen: [tcp/127.0.0.1:7448]}`";
        return Err(Failure::Rejected(problem.help(help).into()));
    };
    let connect = endpoints.reached_at().collect();
    let listen = Vec::new();
    Ok((cell, ZenohEndpoints { listen, connect }))
}
