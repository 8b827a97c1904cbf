//! Names of the files that a recorder writes.

mod like;

use std::io;
use std::path::{Path, PathBuf};

use jiff::Timestamp;
use tauscope_archive::whole_file::part_of;

/// Template of a file name. Its fields are filled in when the file is begun: `{cell}`, `{date}` and `{time}` (UTC, of
/// its first sample, as `2026-11-22` and `14-03-05`) and `{n}` (the first unused number, from 001). `{{` and `}}` are
/// literal braces.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileName {
    parts: Vec<Part>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Part {
    Text(String),
    Cell,
    Date,
    Time,
    Number,
}

/// Error in the template of a file name.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum FileNameError {
    /// An unknown field.
    #[error(
        "`{{{field}}}` is no field of a file name; there are `{{cell}}`, `{{date}}`, `{{time}}` and `{{n}}`"
    )]
    UnknownField {
        /// The text between the braces.
        field: String,
    },
    /// An unpaired brace.
    #[error("a `{{` or `}}` stands alone in the file name `{name}`")]
    LoneBrace {
        /// The name.
        name: String,
    },
    /// A name that is not valid UTF-8.
    #[error("the file name `{name}` is not valid UTF-8")]
    NotText {
        /// The name in lossy form.
        name: String,
    },
}

impl FileName {
    /// Parses a template.
    ///
    /// # Errors
    /// If it contains an unknown field or an unpaired brace.
    pub fn parse(path: &Path) -> Result<Self, FileNameError> {
        let name = path.to_str().ok_or_else(|| FileNameError::NotText {
            name: path.display().to_string(),
        })?;
        let lone = || FileNameError::LoneBrace {
            name: name.to_owned(),
        };
        let mut parts = Vec::new();
        let mut rest = name;
        while !rest.is_empty() {
            let (text, from_brace) = rest.split_at(rest.find(['{', '}']).unwrap_or(rest.len()));
            if !text.is_empty() {
                parts.push(Part::Text(text.to_owned()));
            }
            if from_brace.is_empty() {
                break;
            }
            if let Some(brace) = ["{", "}"]
                .into_iter()
                .find(|b| from_brace.starts_with(&b.repeat(2)))
            {
                parts.push(Part::Text(brace.to_owned()));
                rest = &from_brace[2..];
                continue;
            }
            let inside = from_brace.strip_prefix('{').ok_or_else(lone)?;
            let (field, behind) = inside.split_once('}').ok_or_else(lone)?;
            parts.push(match field {
                "cell" => Part::Cell,
                "date" => Part::Date,
                "time" => Part::Time,
                "n" => Part::Number,
                _ => {
                    return Err(FileNameError::UnknownField {
                        field: field.to_owned(),
                    });
                }
            });
            rest = behind;
        }
        Ok(Self { parts })
    }

    /// Escapes the braces of a path.
    pub fn literal(path: &Path) -> PathBuf {
        match path.to_str() {
            Some(text) => text.replace('{', "{{").replace('}', "}}").into(),
            // A path that is not UTF-8 has no fields.
            None => path.to_owned(),
        }
    }

    /// The path, if it does not depend on time or number.
    pub fn fixed(&self, cell: &str) -> Option<PathBuf> {
        (!self.can_differ()).then(|| self.fill(cell, Timestamp::default(), 0))
    }

    /// Shell pattern that all files of a cell match, with `*` for date, time and number.
    pub fn pattern(&self, cell: &str) -> String {
        let parts = self.parts.iter().map(|part| match part {
            Part::Text(text) => text,
            Part::Cell => cell,
            Part::Date | Part::Time | Part::Number => "*",
        });
        parts.collect()
    }

    /// Whether the name is known before the first sample.
    pub fn is_known_at_start(&self) -> bool {
        !(self.parts.iter()).any(|part| matches!(part, Part::Date | Part::Time))
    }

    /// Whether the template can give several file names.
    pub fn can_differ(&self) -> bool {
        !(self.parts.iter()).all(|part| matches!(part, Part::Text(_) | Part::Cell))
    }

    /// Whether it contains the field for a single cell.
    pub(crate) fn is_of_one_cell(&self) -> bool {
        self.parts.contains(&Part::Cell)
    }

    fn has_number(&self) -> bool {
        self.parts.contains(&Part::Number)
    }

    /// The folder of its files, as far as it is known before the first sample.
    pub fn known_folder(&self, cell: &str) -> PathBuf {
        let mut known = String::new();
        for part in &self.parts {
            match part {
                Part::Text(text) => known += text,
                Part::Cell => known += cell,
                _ => break,
            }
        }
        known.truncate(known.rfind('/').map_or(0, |slash| slash + 1));
        known.into()
    }

    /// Existing files whose names match the template, followed by `ending`. Names with an inserted number such as
    /// `a.1.mcap` match, too.
    ///
    /// # Errors
    /// If an existing folder cannot be read.
    pub(crate) fn all_like(&self, cell: &str, ending: &str) -> io::Result<Vec<PathBuf>> {
        let mut found = Vec::new();
        like::find(PathBuf::new(), &self.components(), cell, ending, &mut found)?;
        found.sort();
        Ok(found)
    }

    /// Its parts by path component; the last component is the file.
    fn components(&self) -> Vec<Vec<Part>> {
        let mut components = Vec::new();
        let mut last = Vec::new();
        for part in &self.parts {
            let Part::Text(text) = part else {
                last.push(part.clone());
                continue;
            };
            for (i, piece) in text.split('/').enumerate() {
                if i > 0 {
                    components.push(std::mem::take(&mut last));
                }
                if !piece.is_empty() {
                    last.push(Part::Text(piece.to_owned()));
                }
            }
        }
        components.push(last);
        components
    }

    fn fill(&self, cell: &str, start: Timestamp, n: u32) -> PathBuf {
        let fill = |part: &Part| match part {
            Part::Text(text) => text.clone(),
            Part::Cell => cell.to_owned(),
            Part::Date => start.strftime("%Y-%m-%d").to_string(),
            Part::Time => start.strftime("%H-%M-%S").to_string(),
            Part::Number => format!("{n:03}"),
        };
        self.parts.iter().map(fill).collect::<String>().into()
    }
}

/// Fills in the names of files that belong together, with the same number for all.
///
/// # Errors
/// If a folder cannot be read.
pub fn fill_in(names: &[&FileName], cell: &str, start_ns: i64) -> io::Result<Vec<PathBuf>> {
    let start = Timestamp::from_nanosecond(i128::from(start_ns)).unwrap_or_default();
    let mut n = 1;
    loop {
        let paths = names.iter().map(|name| name.fill(cell, start, n));
        let paths: Vec<PathBuf> = paths.collect();
        let mut taken = false;
        for (path, _) in paths
            .iter()
            .zip(names)
            .filter(|(_, name)| name.has_number())
        {
            taken |= path.try_exists()? || part_of(path).try_exists()?;
        }
        if !taken {
            return Ok(paths);
        }
        n += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> FileName {
        FileName::parse(Path::new(text)).unwrap()
    }

    /// 22 November 2026, 14:03:05.7 UTC.
    const START_NS: i64 = 1_795_356_185_700_000_000;

    #[test]
    fn a_pattern_matches_all_files_of_a_cell() {
        let name = FileName::parse(Path::new("out/{cell}/{date}-{time}.{n}.mcap")).unwrap();
        assert_eq!(name.pattern("press"), "out/press/*-*.*.mcap");
    }

    #[test]
    fn fields_are_filled_in_with_cell_and_first_sample() {
        let filled = fill_in(&[&name("{cell}/{date}/{time}.mcap")], "press-3", START_NS);
        let expected = Path::new("press-3/2026-11-22/14-03-05.mcap");
        assert_eq!(filled.unwrap(), [expected]);
    }

    #[test]
    fn files_that_belong_together_get_one_number_that_none_of_them_had() {
        let folder = tempfile::tempdir().unwrap();
        let at = |file: &str| folder.path().join(file);
        std::fs::write(at("a-001.rrd"), "").unwrap();
        std::fs::write(at("a-002.mcap.part"), "").unwrap();
        let names = ["a-{n}.mcap", "a-{n}.rrd"].map(|file| FileName::parse(&at(file)).unwrap());
        let filled = fill_in(&names.each_ref(), "cell", START_NS).unwrap();
        assert_eq!(filled, [at("a-003.mcap"), at("a-003.rrd")]);
    }

    #[test]
    fn files_that_a_name_can_become_are_found_and_no_others() {
        let folder = tempfile::tempdir().unwrap();
        let at = |file: &str| folder.path().join(file);
        std::fs::create_dir_all(at("2026-11-22")).unwrap();
        std::fs::create_dir_all(at("notes")).unwrap();
        let ours = [
            "2026-11-22/p-001.mcap",
            "2026-11-22/p-001.3.mcap",
            "2026-11-22/p-1000.mcap",
        ];
        let others = [
            "2026-11-22/p-01.mcap",
            "2026-11-22/q-001.mcap",
            "2026-11-22/p-001.mcap.part",
            "notes/p-001.mcap",
        ];
        for file in ours.iter().chain(&others) {
            std::fs::write(at(file), "").unwrap();
        }
        let name = FileName::parse(&at("{date}/{cell}-{n}.mcap")).unwrap();
        let mut expected = ours.map(&at);
        expected.sort();
        assert_eq!(name.all_like("p", "").unwrap(), expected);
        assert_eq!(name.all_like("p", ".part").unwrap(), [at(others[2])]);
        let elsewhere = FileName::parse(&at("not/there/{n}.mcap")).unwrap();
        assert!(elsewhere.all_like("p", "").unwrap().is_empty());
    }

    #[test]
    fn the_folder_is_known_up_to_the_first_field_that_is_not() {
        for (text, folder) in [
            ("a.mcap", ""),
            ("out/{cell}/a-{n}.mcap", "out/demo/"),
            ("/data/{date}/a.mcap", "/data/"),
        ] {
            assert_eq!(name(text).known_folder("demo"), Path::new(folder), "{text}");
        }
    }

    #[test]
    fn doubled_braces_are_braces() {
        let path = Path::new("a{1}.mcap");
        let literal = FileName::parse(&FileName::literal(path)).unwrap();
        assert_eq!(literal.fixed("cell").unwrap(), path);
    }

    #[test]
    fn what_is_no_field_is_named() {
        let message = |text: &str| FileName::parse(Path::new(text)).unwrap_err().to_string();
        assert!(message("a-{day}.mcap").starts_with("`{day}` is no field of a file name"));
        assert!(message("a-{n.mcap").contains("stands alone"));
        assert!(message("a-n}.mcap").contains("stands alone"));
    }

    #[test]
    fn only_a_date_or_a_time_waits_for_the_first_sample() {
        for (text, at_start, can_differ) in [
            ("a.mcap", true, false),
            ("{cell}.mcap", true, false),
            ("a-{n}.mcap", true, true),
            ("{date}/a.mcap", false, true),
        ] {
            assert_eq!(name(text).is_known_at_start(), at_start, "{text}");
            assert_eq!(name(text).can_differ(), can_differ, "{text}");
        }
    }
}
