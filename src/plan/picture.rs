//! A plan as a picture, for Mermaid and for Graphviz: hosts are boxes, and so are processes of several stages. Names
//! consist of letters, digits, `_` and `-`, so nothing needs escaping.

use std::fmt::Write;

use tauscope_pipeline::pipeline::{Pipeline, Stage, words_for};

use super::{Link, Over};

/// Returns a Mermaid flowchart.
pub fn mermaid(pipeline: &Pipeline, links: &[Link]) -> String {
    let mut text = "flowchart LR\n".to_owned();
    let boxes = |text: &mut String, name: Option<(String, &str)>, inner: &str| match name {
        Some((id, title)) => {
            let _ = writeln!(text, "  subgraph {id} [\"{title}\"]");
            for line in inner.lines() {
                let _ = writeln!(text, "  {line}");
            }
            text.push_str("  end\n");
        }
        None => text.push_str(inner),
    };
    for (host, stages) in by(pipeline, 0..pipeline.stages.len(), |stage| {
        stage.host.as_deref()
    }) {
        let mut on_host = String::new();
        for (process, stages) in by(pipeline, stages, |stage| Some(&stage.process)) {
            let mut in_process = String::new();
            for &index in &stages {
                let stage = &pipeline.stages[index];
                let (name, role) = (&stage.name, stage.role.kind.key);
                let _ = writeln!(in_process, "  s{index}[\"{name}<br/>{role}\"]");
            }
            let several = process.filter(|_| stages.len() > 1);
            let first = stages.first().copied().unwrap_or(0);
            let named = several.map(|name| (format!("process_{first}"), name));
            boxes(&mut on_host, named, &in_process);
        }
        let named = host.map(|name| (format!("host_{name}"), name));
        boxes(&mut text, named, &on_host);
    }
    for link in links {
        let arrow = match link.over {
            Over::InProcess => "==>",
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

/// Returns a Graphviz digraph.
pub fn dot(pipeline: &Pipeline, links: &[Link]) -> String {
    let mut text = "digraph pipeline {\n  rankdir=LR;\n  node [shape=box];\n".to_owned();
    for (host, stages) in by(pipeline, 0..pipeline.stages.len(), |stage| {
        stage.host.as_deref()
    }) {
        if let Some(host) = host {
            let _ = writeln!(
                text,
                "  subgraph \"cluster_{host}\" {{\n  label=\"{host}\";"
            );
        }
        for (process, stages) in by(pipeline, stages, |stage| Some(&stage.process)) {
            let several = process.filter(|_| stages.len() > 1);
            if let Some(process) = several {
                let first = stages.first().copied().unwrap_or(0);
                let _ = writeln!(
                    text,
                    "  subgraph \"cluster_process_{first}\" {{\n  label=\"{process}\"; style=dotted;"
                );
            }
            for index in stages {
                let stage = &pipeline.stages[index];
                let (name, role) = (&stage.name, stage.role.kind.key);
                let _ = writeln!(text, "  s{index} [label=\"{name}\\n{role}\"];");
            }
            if several.is_some() {
                text.push_str("  }\n");
            }
        }
        if host.is_some() {
            text.push_str("  }\n");
        }
    }
    for link in links {
        let style = match link.over {
            Over::InProcess => "bold",
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

/// Groups stages by `key`, in the order of the pipeline.
fn by<'a>(
    pipeline: &'a Pipeline,
    stages: impl IntoIterator<Item = usize>,
    key: fn(&'a Stage) -> Option<&'a str>,
) -> Vec<(Option<&'a str>, Vec<usize>)> {
    let mut groups: Vec<(Option<&str>, Vec<usize>)> = Vec::new();
    for index in stages {
        let key = key(&pipeline.stages[index]);
        match groups.iter_mut().find(|(known, _)| *known == key) {
            Some((_, stages)) => stages.push(index),
            None => groups.push((key, vec![index])),
        }
    }
    groups
}
