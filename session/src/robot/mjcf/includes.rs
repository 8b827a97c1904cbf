//! Files that a MuJoCo model includes.

use std::path::{Path, PathBuf};

use super::MjcfError;

/// The folder that paths in a model begin at.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new("."))
}

/// The model in `xml`, whose file is at `path`, with the files that it includes.
///
/// # Errors
/// If one of them cannot be read.
pub fn whole(xml: &str, path: &Path) -> Result<String, MjcfError> {
    with_includes(xml, folder_of(path), &[path.to_path_buf()])
}

/// The text with each `<include>` replaced by the content of its file, as MuJoCo does it. The parser knows includes only between
/// sections, not within a body. `open` are the files that it stands in, the innermost last.
fn with_includes(xml: &str, folder: &Path, open: &[PathBuf]) -> Result<String, MjcfError> {
    let document = roxmltree::Document::parse(xml);
    let document = document.map_err(|error| {
        let inner = open.last().cloned().unwrap_or_default();
        MjcfError::Xml(inner.display().to_string(), error.to_string())
    })?;
    let mut text = xml.to_owned();
    let includes = document
        .descendants()
        .filter(|node| node.has_tag_name("include"));
    let mut includes: Vec<_> = includes.collect();
    includes.reverse();
    for node in includes {
        let file = folder.join(node.attribute("file").unwrap_or_default());
        let problem = |reason: String| MjcfError::Include {
            file: file.clone(),
            within: open
                .last()
                .map_or_else(String::new, |inner| inner.display().to_string()),
            reason,
        };
        if open.contains(&file) {
            return Err(problem("it includes itself, over others or not".to_owned()));
        }
        let own = std::fs::read_to_string(&file).map_err(|error| problem(error.to_string()))?;
        let within = [open, std::slice::from_ref(&file)].concat();
        let own = with_includes(&own, folder, &within)?;
        let included = roxmltree::Document::parse(&own);
        let included = included.map_err(|error| problem(error.to_string()))?;
        let parts = included
            .root_element()
            .children()
            .map(|child| &own[child.range()]);
        text.replace_range(node.range(), &parts.collect::<String>());
    }
    Ok(text)
}
