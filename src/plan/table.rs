//! A plan as tables on a terminal.

use comfy_table::{Table, presets};
use tauscope_bus::Keep;
use tauscope_pipeline::pipeline::{Pipeline, words_for};

use super::Link;

/// Formats the stages, hosts and links.
pub fn table(pipeline: &Pipeline, links: &[Link]) -> String {
    let mut parts = vec![stages(pipeline)];
    if pipeline.hosts.len() > 1 {
        parts.push(hosts(pipeline));
    }
    parts.push(link_table(pipeline, links));
    parts.join("\n\n")
}

fn new(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_preset(presets::UTF8_FULL_CONDENSED)
        .set_header(header);
    table
}

fn stages(pipeline: &Pipeline) -> String {
    let mut table = new(&[
        "stage",
        "kind",
        "cell",
        "host",
        "process",
        "listens to",
        "puts out",
    ]);
    for stage in &pipeline.stages {
        let inputs: Vec<&str> = stage
            .inputs
            .iter()
            .map(|&from| pipeline.stages[from].name.as_str())
            .collect();
        let cells: Vec<&str> = stage.cells.iter().map(String::as_str).collect();
        table.add_row([
            stage.name.clone(),
            stage.role.kind.key.to_owned(),
            cells.join(", "),
            stage.host.clone().unwrap_or_else(|| "this one".to_owned()),
            stage.process.clone(),
            inputs.join(", "),
            stage.role.gives.map_or("", words_for).to_owned(),
        ]);
    }
    table.trim_fmt()
}

fn hosts(pipeline: &Pipeline) -> String {
    let mut table = new(&["host", "listens on", "connects to", "stages"]);
    for (name, host) in &pipeline.hosts {
        let stages: Vec<&str> = pipeline
            .stages
            .iter()
            .filter(|stage| stage.host.as_ref() == Some(name))
            .map(|stage| stage.name.as_str())
            .collect();
        table.add_row([
            name.clone(),
            host.listen.0.join(", "),
            host.connect.0.join(", "),
            stages.join(", "),
        ]);
    }
    table.trim_fmt()
}

fn link_table(pipeline: &Pipeline, links: &[Link]) -> String {
    let mut table = new(&["from", "to", "carries", "over", "keeps"]);
    for link in links {
        table.add_row([
            pipeline.stages[link.from].name.as_str(),
            pipeline.stages[link.to].name.as_str(),
            words_for(link.carries),
            link.over.as_str(),
            keep_word(link.keep),
        ]);
    }
    table.trim_fmt()
}

/// Returns the keyword of an overflow policy in pipeline files.
pub fn keep_word(keep: Keep) -> &'static str {
    match keep {
        Keep::All => "all",
        Keep::Newest => "newest",
    }
}
