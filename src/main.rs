//! The `tauscope` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    tauscope::main()
}
