//! Output of a command.

use std::io::Write as _;

/// Destination of a command's results and warnings.
#[derive(Debug)]
pub enum Output {
    /// To standard output and standard error.
    Terminal,
    /// Into memory: what would go to standard output, and what would go to standard error.
    Memory(String, String),
}

impl Output {
    /// Writes a result. A closed pipe, as with `head`, is no failure.
    pub fn print(&mut self, text: &str) -> anyhow::Result<()> {
        let text = text.trim_end();
        match self {
            Self::Terminal => match writeln!(std::io::stdout().lock(), "{text}") {
                Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
                _ => Ok(()),
            },
            Self::Memory(results, _) => {
                results.push_str(text);
                results.push('\n');
                Ok(())
            }
        }
    }

    /// Writes a line for people: a warning, a note or an error.
    pub fn say(&mut self, line: &str) {
        match self {
            Self::Terminal => eprintln!("{line}"),
            Self::Memory(_, said) => {
                said.push_str(line);
                said.push('\n');
            }
        }
    }
}
