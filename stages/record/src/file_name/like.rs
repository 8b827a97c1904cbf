//! Search for files whose names match a template.

use std::io;
use std::path::{Path, PathBuf};

use super::Part;

/// Adds the files below `folder` that match `components`.
pub(super) fn find(
    folder: PathBuf,
    components: &[Vec<Part>],
    cell: &str,
    ending: &str,
    found: &mut Vec<PathBuf>,
) -> io::Result<()> {
    let Some((component, below)) = components.split_first() else {
        return Ok(());
    };
    let is_file = below.is_empty();
    if !is_file && component.is_empty() {
        // An empty component is the root of an absolute path or a repeated slash.
        let folder = if folder == Path::new("") {
            PathBuf::from("/")
        } else {
            folder
        };
        return find(folder, below, cell, ending, found);
    }
    let here = if folder == Path::new("") {
        Path::new(".")
    } else {
        &folder
    };
    if !is_file && component.iter().all(|part| part_text(part, cell).is_some()) {
        let name: String = component
            .iter()
            .filter_map(|part| part_text(part, cell))
            .collect();
        return find(folder.join(name), below, cell, ending, found);
    }
    let entries = match std::fs::read_dir(here) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries?,
    };
    for entry in entries {
        let entry = entry?;
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        if is_file {
            if let Some(name_alone) = name.strip_suffix(ending)
                && is_like_file(component, cell, name_alone)
            {
                found.push(folder.join(name));
            }
        } else if is_like(component, cell, name) && entry.file_type()?.is_dir() {
            find(folder.join(name), below, cell, ending, found)?;
        }
    }
    Ok(())
}

fn part_text<'a>(part: &'a Part, cell: &'a str) -> Option<&'a str> {
    match part {
        Part::Text(text) => Some(text),
        Part::Cell => Some(cell),
        Part::Date | Part::Time | Part::Number => None,
    }
}

/// Whether a file name matches, also with a number before the extension, as added to a name that is already used.
fn is_like_file(parts: &[Part], cell: &str, name: &str) -> bool {
    if is_like(parts, cell, name) {
        return true;
    }
    let Some((stem, extension)) = name.rsplit_once('.') else {
        return false;
    };
    let Some((stem, number)) = stem.rsplit_once('.') else {
        return false;
    };
    !number.is_empty()
        && number.bytes().all(|b| b.is_ascii_digit())
        && is_like(parts, cell, &format!("{stem}.{extension}"))
}

fn is_like(parts: &[Part], cell: &str, name: &str) -> bool {
    let Some((part, rest)) = parts.split_first() else {
        return name.is_empty();
    };
    if let Some(text) = part_text(part, cell) {
        return name
            .strip_prefix(text)
            .is_some_and(|name| is_like(rest, cell, name));
    }
    match part {
        Part::Date => shaped("dddd-dd-dd", name).is_some_and(|name| is_like(rest, cell, name)),
        Part::Time => shaped("dd-dd-dd", name).is_some_and(|name| is_like(rest, cell, name)),
        _ => {
            let digits = name.bytes().take_while(u8::is_ascii_digit).count();
            (3..=digits).any(|digits| is_like(rest, cell, &name[digits..]))
        }
    }
}

/// The rest of `name` after a text of this shape, in which `d` stands for a digit.
fn shaped<'a>(shape: &str, name: &'a str) -> Option<&'a str> {
    let (text, rest) = name.split_at_checked(shape.len())?;
    let fits = |(shape, byte): (u8, u8)| match shape {
        b'd' => byte.is_ascii_digit(),
        other => byte == other,
    };
    shape.bytes().zip(text.bytes()).all(fits).then_some(rest)
}
