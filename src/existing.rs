//! Results never take the place of files that are there, unless somebody says so.

use std::path::{Path, PathBuf};

use tauscope_pipeline::report::Problem;

use crate::exit::Failure;

/// Files that are named; the rest is counted.
const MAX_NAMED: usize = 5;

/// Whether results may take the place of files.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub struct Force {
    /// Replace files that have the names of the results.
    #[arg(long)]
    force: bool,
}

impl Force {
    /// Refuses where one of `results` is there already, and nobody said that it may be replaced. Nothing is
    /// touched here.
    ///
    /// # Errors
    /// The files in the way: the first few and their number.
    pub fn check(self, results: impl IntoIterator<Item = PathBuf>) -> Result<(), Failure> {
        if self.force {
            return Ok(());
        }
        // A link that leads nowhere is in the way, too.
        let mut there: Vec<PathBuf> = results
            .into_iter()
            .filter(|path| path.symlink_metadata().is_ok())
            .collect();
        there.sort();
        there.dedup();
        match &there[..] {
            [] => Ok(()),
            [file] => {
                let title = format!("{} is there already", file.display());
                Err(refused(&title))
            }
            files => {
                let folder = files[0].parent().unwrap_or(Path::new(""));
                let name = |path: &PathBuf| {
                    let below = path.strip_prefix(folder).unwrap_or(path);
                    below.display().to_string()
                };
                let named: Vec<String> = files.iter().take(MAX_NAMED).map(name).collect();
                let more = match files.len().saturating_sub(MAX_NAMED) {
                    0 => String::new(),
                    more => format!(" and {more} more"),
                };
                let title = format!(
                    "{} holds {} files of these results already: {}{more}",
                    if folder == Path::new("") {
                        Path::new(".")
                    } else {
                        folder
                    }
                    .display(),
                    files.len(),
                    named.join(", ")
                );
                Err(refused(&title))
            }
        }
    }
}

fn refused(title: &str) -> Failure {
    let help = "give another place with --out, or replace what is there with --force";
    Failure::Rejected(Problem::new(title).help(help).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn title(failure: Failure) -> String {
        match failure {
            Failure::Rejected(report) => report.to_string(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_is_in_the_way_is_named_and_counted() {
        let folder = tempfile::tempdir().unwrap();
        let results = || (0..9).map(|n| folder.path().join(format!("{n}.csv")));
        let force = |force| Force { force };
        force(false).check(results()).unwrap();
        std::fs::write(folder.path().join("3.csv"), "").unwrap();
        let one = title(force(false).check(results()).unwrap_err());
        assert!(one.contains("3.csv is there already"), "{one}");
        for path in results() {
            std::fs::write(path, "").unwrap();
        }
        let all = title(force(false).check(results()).unwrap_err());
        assert!(
            all.contains("9 files") && all.contains("4.csv and 4 more"),
            "{all}"
        );
        assert!(all.contains("--force"), "{all}");
        force(true).check(results()).unwrap();
    }
}
