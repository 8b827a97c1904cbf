//! Protection of existing files: results replace them only with `--force`, and never replace an input.

use std::path::{Path, PathBuf};

use tauscope_pipeline::report::{Problem, Report};

use crate::exit::Failure;

/// Maximum number of files that an error names; the others are counted.
const MAX_NAMED: usize = 5;

/// Whether results may replace existing files.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub struct Force {
    /// Replace existing files that have the names of the results.
    #[arg(long)]
    force: bool,
}

impl Force {
    /// Checks like [`check`](Self::check), and also fails if a result would replace an input of the command. This is
    /// never allowed, because the input would be lost.
    ///
    /// # Errors
    /// The inputs that would be replaced, or else the existing files.
    pub fn check_beside<'a>(
        self,
        results: impl IntoIterator<Item = PathBuf>,
        inputs: impl IntoIterator<Item = &'a PathBuf>,
    ) -> Result<(), Failure> {
        let results: Vec<PathBuf> = results.into_iter().collect();
        keep_inputs(&results, inputs)?;
        self.check(results)
    }

    /// Fails if one of `results` exists already, unless `--force` is given. Changes no file.
    ///
    /// # Errors
    /// The existing files: the first few, and their number.
    pub fn check(self, results: impl IntoIterator<Item = PathBuf>) -> Result<(), Failure> {
        if self.force {
            return Ok(());
        }
        // A dangling symbolic link is an existing file, too.
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
                // Innermost common folder of the files.
                let mut folder = files[0].parent().unwrap_or(Path::new(""));
                while let Some(above) = folder.parent()
                    && !files.iter().all(|file| file.starts_with(folder))
                {
                    folder = above;
                }
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

/// Fails if one of `results` would replace one of `inputs`.
///
/// # Errors
/// Each input that would be replaced.
pub fn keep_inputs<'a>(
    results: &[PathBuf],
    inputs: impl IntoIterator<Item = &'a PathBuf>,
) -> Result<(), Report> {
    let mut report = Report::default();
    for input in inputs {
        if let Some(result) = results.iter().find(|result| takes_place(result, input)) {
            let name = result.file_name().unwrap_or_default().display();
            let title = format!("the result {name} would overwrite {}", input.display());
            report.push(Problem::new(title).help("give another place with --out"));
        }
    }
    report.into_result(())
}

/// Whether the file at `result` is `input`, or a piece of it if it is the folder of a recording.
fn takes_place(result: &Path, input: &Path) -> bool {
    const PIECES: [&str; 3] = ["mcap", "db3", "yaml"];
    let (Ok(result), Ok(input)) = (result.canonicalize(), input.canonicalize()) else {
        return false;
    };
    let is_piece = || {
        let ending = result.extension().and_then(|ending| ending.to_str());
        ending.is_some_and(|ending| PIECES.contains(&ending))
    };
    result == input || (input.is_dir() && result.parent() == Some(&*input) && is_piece())
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

    #[test]
    fn an_input_is_never_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let bag = folder.path().join("bag");
        std::fs::create_dir(&bag).unwrap();
        let piece = bag.join("bag_0.mcap");
        std::fs::write(&piece, "").unwrap();
        let force = Force { force: true };
        for input in [&piece, &bag, &bag.join("../bag/bag_0.mcap")] {
            let told = title(force.check_beside([piece.clone()], [input]).unwrap_err());
            assert!(told.contains("would overwrite"), "{told}");
        }
        let beside = bag.join("summary.parquet");
        force.check_beside([beside], [&piece, &bag]).unwrap();
    }
}
