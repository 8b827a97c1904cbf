//! A Python with packages from PyPI, in a venv under `target/`.

use std::path::PathBuf;
use std::process::Command;

use crate::common::root;

/// A Python that can `import` these modules from these packages; without Python, or where the packages cannot be had,
/// says what is missing.
pub fn python(venv: &str, packages: &[&str], modules: &str) -> Result<PathBuf, String> {
    let venv = root().join("target").join(venv);
    let python = venv.join("bin/python");
    let run = |command: &mut Command| match command.output() {
        Ok(out) if out.status.success() => Ok(()),
        Ok(out) => Err(String::from_utf8_lossy(&out.stderr).trim().to_owned()),
        Err(error) => Err(error.to_string()),
    };
    let ready = || run(Command::new(&python).args(["-c", &format!("import {modules}")]));
    if ready().is_err() {
        run(Command::new("python3")
            .args(["-m", "venv", "--clear"])
            .arg(&venv))
        .map_err(|error| format!("no Python with venv: {error}"))?;
        run(Command::new(&python)
            .args(["-m", "pip", "install", "--quiet"])
            .args(packages))
        .map_err(|error| format!("{} cannot be installed: {error}", packages.join(" ")))?;
        ready().map_err(|error| format!("the packages do not work: {error}"))?;
    }
    Ok(python)
}
