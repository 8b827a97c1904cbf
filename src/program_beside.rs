//! Programs that are built separately, so that only users of SQL have to build `DataFusion`.

use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::PathBuf;
use std::process::Command;

use anyhow::Context as _;
use tauscope_pipeline::report::Problem;

use crate::exit::{Exit, Failure};
use crate::output::Output;

/// A program of the workspace in `query/`.
#[derive(Debug, Clone, Copy)]
pub struct Program {
    /// Its name.
    pub name: &'static str,
    /// Its help text, printed if it is not installed.
    pub help: &'static str,
}

impl Program {
    /// Returns the command that builds it.
    fn build(self) -> String {
        format!(
            "cargo build --release --manifest-path query/Cargo.toml --target-dir target -p {}",
            self.name
        )
    }
}

/// Runs the program, which is searched next to this one and on the PATH. If it is missing, `--help` still prints its
/// help text.
pub fn run(program: Program, arguments: &[OsString], out: &mut Output) -> Result<Exit, Failure> {
    let name = program.name;
    let beside = std::env::current_exe()
        .ok()
        .map(|program| program.with_file_name(name))
        .filter(|program| program.is_file());
    let path = beside.unwrap_or_else(|| PathBuf::from(name));
    let mut command = Command::new(&path);
    command.args(arguments);
    let status = match out {
        Output::Terminal => command.status(),
        Output::Memory(stdout, stderr) => command.output().map(|answer| {
            stdout.push_str(&String::from_utf8_lossy(&answer.stdout));
            stderr.push_str(&String::from_utf8_lossy(&answer.stderr));
            answer.status
        }),
    };
    match status {
        Ok(status) => Ok(match status.code() {
            Some(0) => Exit::Done,
            Some(2) => Exit::Rejected,
            _ => Exit::Failed,
        }),
        Err(error) if error.kind() == ErrorKind::NotFound && asks_for_help(arguments) => {
            let (help, build) = (program.help.trim_end(), program.build());
            out.print(&format!(
                "{help}\n\nThe program behind this command, {name}, is built apart, and is not here yet. Build it in the \
                 folder of the project:\n  {build}"
            ))?;
            Ok(Exit::Done)
        }
        Err(error) if error.kind() == ErrorKind::NotFound => {
            let title = format!("{name} is neither next to this program nor on the PATH");
            let build = format!("build it in the folder of the project: {}", program.build());
            Err(Failure::Rejected(Problem::new(title).help(build).into()))
        }
        Err(error) => Err(error)
            .with_context(|| path.display().to_string())
            .map_err(Failure::from),
    }
}

fn asks_for_help(arguments: &[OsString]) -> bool {
    let mut words = arguments.iter().filter_map(|argument| argument.to_str());
    words.any(|word| matches!(word, "--help" | "-h"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A program that does not exist.
    const MISSING: Program = Program {
        name: "tauscope-that-is-not-built",
        help: "What it does.",
    };

    fn answer(argument: &str) -> (Result<Exit, Failure>, String) {
        let mut out = Output::Memory(String::new(), String::new());
        let ended = run(MISSING, &[argument.into()], &mut out);
        let Output::Memory(printed, _) = out else {
            return (ended, String::new());
        };
        (ended, printed)
    }

    #[test]
    fn help_needs_no_program() {
        for word in ["--help", "-h"] {
            let (ended, printed) = answer(word);
            assert!(matches!(ended, Ok(Exit::Done)), "{ended:?}");
            assert!(printed.starts_with("What it does.\n"), "{printed}");
            assert!(
                printed.contains("-p tauscope-that-is-not-built"),
                "{printed}"
            );
        }
    }

    #[test]
    fn a_query_without_the_program_says_how_to_build_it() {
        let (ended, printed) = answer("select 1");
        let Err(Failure::Rejected(report)) = ended else {
            panic!("{ended:?}");
        };
        let text = report.render(false);
        assert!(
            text.contains("cargo build --release --manifest-path query/Cargo.toml"),
            "{text}"
        );
        assert!(printed.is_empty(), "{printed}");
    }
}
