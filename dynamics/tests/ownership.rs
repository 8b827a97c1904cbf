//! All properties of an effect are defined in its own file: no other code uses the name of an effect.

use std::path::{Path, PathBuf};

use tauscope_dynamics::terms::EFFECTS;

/// Folders whose code must not use the names.
const ROOMS: [&str; 4] = ["src", "stages", "evaluate", "pipeline"];

/// Lines in which such a word has another meaning.
const OTHER_MEANINGS: [&str; 1] = ["Verdict::UnknownRemains"];

fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_dir() && name != "tests" && name != "target" {
            sources(&path, into);
        } else if name.ends_with(".rs") && name != "tests.rs" {
            into.push(path);
        }
    }
}

/// Code lines of a file up to its tests, without comments.
fn code(text: &str) -> impl Iterator<Item = &str> {
    let tests = text
        .match_indices("#[cfg(test)]")
        .map(|(at, _)| at)
        .find(|at| {
            let mut rest = text[*at..].lines().skip(1);
            rest.find(|line| !line.starts_with("#["))
                .is_some_and(|line| line.contains("mod ") && line.ends_with('{'))
        });
    let lines = text[..tests.unwrap_or(text.len())].lines();
    lines.filter(|line| !line.trim_start().starts_with("//"))
}

#[test]
fn nobody_asks_for_an_effect_by_its_quoted_name() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut files = Vec::new();
    for room in ROOMS {
        sources(&root.join(room), &mut files);
    }
    assert!(files.len() > 100, "the code is there: {}", files.len());
    let quoted: Vec<String> = EFFECTS.iter().map(|e| format!("\"{}\"", e.name)).collect();
    let mut found = Vec::new();
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        for line in code(&text) {
            let asks = quoted.iter().any(|name| line.contains(name));
            if asks && !OTHER_MEANINGS.iter().any(|known| line.contains(known)) {
                found.push(format!("{}: {}", file.display(), line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
