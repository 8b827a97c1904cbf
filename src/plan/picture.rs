//! A plan as a picture, for Mermaid and for Graphviz. Names are letters, digits, `_` and `-`, so
//! nothing needs escaping.

use std::fmt::Write;

use tauscope_pipeline::pipeline::{Pipeline, Stage, words_for};

use super::{Link, Over};

/// A Mermaid flowchart, hosts as boxes around their stages.
pub fn mermaid(pipeline: &Pipeline, links: &[Link]) -> String {
    let mut text = "flowchart LR\n".to_owned();
    for (host, stages) in by_host(pipeline) {
        let indent = if host.is_some() { "    " } else { "  " };
        if let Some(host) = host {
            let _ = writeln!(text, "  subgraph host_{host} [\"{host}\"]");
        }
        for (index, stage) in stages {
            let _ = writeln!(
                text,
                "{indent}s{index}[\"{}<br/>{}\"]",
                stage.name,
                stage.role.key()
            );
        }
        if host.is_some() {
            text.push_str("  end\n");
        }
    }
    for link in links {
        let arrow = match link.over {
            Over::SharedMemory => "-->",
            Over::Zenoh => "-.->",
        };
        let _ = writeln!(
            text,
            "  s{} {arrow}|{}| s{}",
            link.from,
            words_for(link.carries),
            link.to
        );
    }
    text
}

/// A Graphviz digraph, hosts as clusters.
pub fn dot(pipeline: &Pipeline, links: &[Link]) -> String {
    let mut text = "digraph pipeline {\n  rankdir=LR;\n  node [shape=box];\n".to_owned();
    for (host, stages) in by_host(pipeline) {
        if let Some(host) = host {
            let _ = writeln!(
                text,
                "  subgraph \"cluster_{host}\" {{\n  label=\"{host}\";"
            );
        }
        for (index, stage) in stages {
            let _ = writeln!(
                text,
                "  s{index} [label=\"{}\\n{}\"];",
                stage.name,
                stage.role.key()
            );
        }
        if host.is_some() {
            text.push_str("  }\n");
        }
    }
    for link in links {
        let style = match link.over {
            Over::SharedMemory => "solid",
            Over::Zenoh => "dashed",
        };
        let label = words_for(link.carries);
        let _ = writeln!(
            text,
            "  s{} -> s{} [label=\"{label}\", style={style}];",
            link.from, link.to
        );
    }
    text.push_str("}\n");
    text
}

type OnHost<'a> = (Option<&'a str>, Vec<(usize, &'a Stage)>);

fn by_host(pipeline: &Pipeline) -> Vec<OnHost<'_>> {
    let mut groups: Vec<OnHost<'_>> = Vec::new();
    for (index, stage) in pipeline.stages.iter().enumerate() {
        let host = stage.host.as_deref();
        match groups.iter_mut().find(|(known, _)| *known == host) {
            Some((_, stages)) => stages.push((index, stage)),
            None => groups.push((host, vec![(index, stage)])),
        }
    }
    groups
}
