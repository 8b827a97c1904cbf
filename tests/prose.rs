//! The Markdown texts: lines that an editor shows whole, and links that lead somewhere.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::{Path, PathBuf};

/// The longest line outside a table, in characters.
const LONGEST: usize = 120;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every Markdown file of the tree but those that a build or a run has made.
fn texts() -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    let mut folders = vec![root().to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() && !["target", "out", ".git"].contains(&name.as_str()) {
                folders.push(path);
            } else if Path::new(&name)
                .extension()
                .is_some_and(|kind| kind == "md")
            {
                let text = std::fs::read_to_string(&path).unwrap();
                found.push((path, text));
            }
        }
    }
    assert!(found.len() > 15, "{} texts", found.len());
    found
}

/// The anchors of a text's headings, as GitHub makes them.
fn anchors(text: &str) -> Vec<String> {
    headings(text)
        .map(|heading| {
            heading
                .to_lowercase()
                .replace(' ', "-")
                .chars()
                .filter(|c| c.is_alphanumeric() || *c == '-' || *c == '_')
                .collect()
        })
        .collect()
}

fn headings(text: &str) -> impl Iterator<Item = &str> {
    outside_code(text)
        .filter(|line| line.starts_with('#'))
        .map(|line| line.trim_start_matches('#').trim())
}

/// The lines that stand in no fenced block.
fn outside_code(text: &str) -> impl Iterator<Item = &str> {
    let mut fenced = false;
    text.lines().filter(move |line| {
        let fence = line.trim_start().starts_with("```");
        fenced ^= fence;
        !fenced && !fence
    })
}

#[test]
fn no_line_outside_a_table_is_longer_than_an_editor_shows() {
    let mut long = Vec::new();
    for (path, text) in texts() {
        for (number, line) in text.lines().enumerate() {
            let length = line.chars().count();
            if length > LONGEST && !line.starts_with('|') {
                long.push(format!("{}:{}: {length}", path.display(), number + 1));
            }
        }
    }
    assert!(long.is_empty(), "{}", long.join("\n"));
}

#[test]
fn every_link_to_a_file_or_a_heading_leads_there() {
    let mut broken = Vec::new();
    for (path, text) in texts() {
        for target in text
            .split("](")
            .skip(1)
            .map(|rest| &rest[..rest.find(')').unwrap_or(0)])
        {
            if target.is_empty() || target.contains("://") || target.contains(' ') {
                continue;
            }
            let (file, anchor) = target.split_once('#').unwrap_or((target, ""));
            let file = if file.is_empty() {
                path.clone()
            } else {
                path.parent().unwrap().join(file)
            };
            let there = file.exists()
                && (anchor.is_empty()
                    || anchors(&std::fs::read_to_string(&file).unwrap())
                        .iter()
                        .any(|a| a == anchor));
            if !there {
                broken.push(format!("{}: {target}", path.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// Path below `docs/` and text of each page of the book: every Markdown file there but the summary.
fn pages() -> Vec<(String, String)> {
    let docs = root().join("docs");
    let mut found: Vec<(String, String)> = texts()
        .into_iter()
        .filter_map(|(path, text)| {
            let page = path.strip_prefix(&docs).ok()?.to_str()?.to_owned();
            (page != "SUMMARY.md").then_some((page, text))
        })
        .collect();
    found.sort();
    found
}

#[test]
fn the_summary_lists_every_page_once() {
    let summary = std::fs::read_to_string(root().join("docs/SUMMARY.md")).unwrap();
    let mut listed: Vec<String> = summary
        .split("](")
        .skip(1)
        .map(|rest| rest[..rest.find(')').unwrap()].to_owned())
        .collect();
    listed.sort();
    let expected: Vec<String> = pages().into_iter().map(|(page, _)| page).collect();
    assert_eq!(listed, expected);
}

#[test]
fn every_page_begins_with_a_heading_and_a_sentence() {
    for (page, text) in pages() {
        let mut blocks = text.split("\n\n");
        let heading = blocks.next().unwrap_or("");
        let first = blocks.next().unwrap_or("");
        let is_text = first.starts_with(|c: char| c.is_alphabetic() || c == '`');
        let has_end = first.split_whitespace().any(|word| word.ends_with('.'));
        assert!(heading.starts_with("# "), "{page}: {heading}");
        assert!(is_text && has_end, "{page}: {first}");
    }
}

/// The names of files in backticks.
fn named_files(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2).filter(|name| {
        Path::new(name).extension().is_some_and(|kind| kind == "rs")
            && !name.contains(['{', '<', ' '])
    })
}

#[test]
fn every_source_file_that_the_architecture_names_is_there() {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let sources = std::process::Command::new("git")
        .args([
            "ls-files",
            "--cached",
            "--others",
            "--exclude-standard",
            "*.rs",
        ])
        .current_dir(root())
        .output()
        .unwrap();
    let sources = String::from_utf8(sources.stdout).unwrap();
    let missing: Vec<&str> = named_files(&text)
        .filter(|name| {
            let ending = format!("/{name}");
            !sources
                .lines()
                .any(|path| path == *name || path.ends_with(&ending))
        })
        .collect();
    assert!(!sources.is_empty() && missing.is_empty(), "{missing:?}");
}
