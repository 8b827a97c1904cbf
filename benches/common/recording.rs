//! A recording to measure on.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The bundled arm.
pub fn robot() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/demo_arm.urdf")
}

/// Makes a recording of the bundled arm at 1 kHz in `folder`.
pub fn simulate(folder: &Path, seconds: u32) -> PathBuf {
    let scenario = format!(
        "version: 1\nname: bench\nrobot: {}\nrate_hz: 1000\nrecordings:\n  - name: loop\n    duration_s: {seconds}\n    \
         motion: {{fourier: {{period_s: 10, harmonics: 4, speed: 0.4, acceleration_rad_s2: 2.5, range: 0.5}}}}\n",
        robot().display()
    );
    let file = folder.join("scenario.yaml");
    std::fs::write(&file, scenario).expect("the folder can be written");
    let out = folder.join("simulated");
    let arguments = [
        OsStr::new("simulate"),
        file.as_os_str(),
        OsStr::new("--out"),
        out.as_os_str(),
    ];
    let answer = tauscope::answer(arguments);
    assert_eq!(answer.code, 0, "{}", answer.stderr);
    out.join("loop.mcap")
}
