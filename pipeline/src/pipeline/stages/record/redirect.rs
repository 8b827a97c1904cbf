//! Output paths of a recorder in a replay.

use std::path::{Path, PathBuf};

use tauscope_record::{Config, Existing, FileName};

/// Returns a recorder's configuration for a replay: the same kinds of file, written to `out` and named after the
/// recording, without a connection to a live viewer. `None` without `out`.
pub fn redirect(
    config: &Config,
    out: Option<&Path>,
    recording: &Path,
    files: &mut Vec<PathBuf>,
) -> Option<Config> {
    let out = out?;
    let stem = tauscope_archive::name_of(recording);
    let mut config = Config {
        // Each replay replaces the result of the recording.
        split: None,
        keep: None,
        existing: Existing::Replace,
        // No periodic sync: another replay restores files that a power failure destroyed.
        sync_s: 0.0,
        ..config.clone()
    };
    if let Some(around) = &mut config.around_alarms {
        for (path, kind) in [(&mut around.mcap, "mcap"), (&mut around.rerun, "rrd")] {
            let stem = FileName::literal(&out.join(&stem));
            let name = format!("{}.alarm-{{date}}-{{time}}.{kind}", stem.display());
            *path = path.take().map(|_| name.into());
        }
    }
    if config.mcap.is_some() {
        let path = out.join(format!("{stem}.mcap"));
        config.mcap = Some(FileName::literal(&path));
        files.push(path);
    }
    if let Some(rerun) = &mut config.rerun {
        rerun.connect = None;
        if rerun.file.is_some() {
            let path = out.join(format!("{stem}.rrd"));
            rerun.file = Some(FileName::literal(&path));
            files.push(path);
        }
    }
    config.writes_something().then_some(config)
}
