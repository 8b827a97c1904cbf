//! What a detector has learnt: read from the file that its settings name, and kept from one run to the next.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use tauscope_bus::{Detection, Emit, Stage, StageError, TwinState};
use tauscope_detect::{Config, Detect, StateFile};

use crate::report::Report;
use crate::suggest;
use crate::yaml::{self, Place};
use tauscope_archive::whole_file::{self, Existing};

/// Time between two writes, in time of the stream \[ns\]. What was learnt since is lost if the process
/// dies.
/// Resolution: writes to disk, against what a killed process forgets.
const WRITE_EVERY_NS: i64 = 60_000_000_000;

/// Lets the detector go on from what the file that `config` names holds, if there is one yet. Gives the
/// file's path.
///
/// # Errors
/// Everything that is wrong with the file.
pub fn resume(config: &mut Config) -> Result<Option<PathBuf>, Report> {
    let path = config.state_mut().cloned();
    if let Some(path) = path.as_ref().filter(|path| path.exists()) {
        let state = yaml::load::<StateFile>(path)?;
        let resumed = config.resume(&state.value.0);
        resumed.map_err(|error| state.at(&Place::root(), error.to_string()))?;
    }
    Ok(path)
}

/// Replaces the file of what was learnt that `config` names, if it names one, by its content. Such a file is
/// `learnt.yaml` as `init` and `evaluate` write it: by detector, its part of a pipeline file.
///
/// # Errors
/// Everything that is wrong with the file.
pub fn read_learnt(config: &mut Config, resolve: &dyn Fn(&Path) -> PathBuf) -> Result<(), Report> {
    let named = config.learnt_files().next();
    let Some((name, path)) = named.map(|(name, path)| (name, resolve(path))) else {
        return Ok(());
    };
    let file = yaml::load::<BTreeMap<String, Config>>(&path)?;
    let place = Place::root().key(name);
    let learnt = file.value.get(name).and_then(|config| config.learnt(name));
    let Some(learnt) = learnt else {
        let learned = file.value.iter();
        let learned = learned.filter(|(name, config)| config.learnt(name).is_some());
        let problem = file.at(&place, format!("nothing that {name} has learnt"));
        let help = format!(
            "in this file have learnt: {}",
            suggest::list(learned.map(|(name, _)| name.as_str()))
        );
        return Err(problem.help(help).into());
    };
    let place = place.key(name).key("learnt");
    (config.resume(&learnt)).map_err(|error| file.at(&place, error.to_string()).into())
}

/// A detector whose learnt state is written to a file, once a minute and at the end. Its stream is
/// untouched.
pub struct Kept {
    stage: Detect,
    path: Option<PathBuf>,
    written_ns: Option<i64>,
}

impl Kept {
    /// `stage`, whose state is kept at `path`, if anywhere.
    pub fn new(stage: Detect, path: Option<PathBuf>) -> Self {
        Self {
            stage,
            path,
            written_ns: None,
        }
    }

    fn write(&self) -> Result<(), StageError> {
        let (Some(path), Some(learnt)) = (&self.path, self.stage.learnt()) else {
            return Ok(());
        };
        let failed = |error: String| {
            let path = path.display();
            StageError::failed(format!("cannot keep what was learnt in {path}: {error}"))
        };
        let text = serde_saphyr::to_string(&learnt).map_err(|error| failed(error.to_string()))?;
        whole_file::write(path, text, Existing::Replace).map_err(|error| failed(error.to_string()))
    }
}

impl Stage<TwinState, Detection> for Kept {
    fn accept(
        &mut self,
        sample: &TwinState,
        out: &mut dyn Emit<Detection>,
    ) -> Result<(), StageError> {
        self.stage.accept(sample, out)?;
        let stamp_ns = sample.header.stamp_ns;
        let written_ns = *self.written_ns.get_or_insert(stamp_ns);
        if !(0..WRITE_EVERY_NS).contains(&(stamp_ns - written_ns)) {
            self.written_ns = Some(stamp_ns);
            self.write()?;
        }
        Ok(())
    }

    fn finish(&mut self, out: &mut dyn Emit<Detection>) -> Result<(), StageError> {
        self.stage.finish(out)?;
        self.write()
    }

    fn dropped(&self) -> u64 {
        self.stage.dropped()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

    use tauscope_bus::{Header, LinkError, flags};
    use tauscope_detect::indri::virtual_collision_sensor::{FirstBias, Settings};
    use tauscope_detect::{JointSetup, Setup};

    use super::*;

    struct Nowhere;

    impl Emit<Detection> for Nowhere {
        fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
            write(&mut Detection::default());
            Ok(())
        }
    }

    fn kept(path: &Path) -> Kept {
        let mut config = Config::of(Settings {
            bias: Some(FirstBias::InOrder(vec![1.0])),
            state: Some(path.to_owned()),
            ..Settings::default()
        });
        assert_eq!(resume(&mut config).unwrap().as_deref(), Some(path));
        let joint = JointSetup {
            gain: 1.0,
            offset: 0.0,
            noise: None,
            effort_per_nm: 1.0,
        };
        let setup = Setup {
            joints: vec![joint],
            joint_names: vec!["elbow".to_owned()],
            ..Setup::default()
        };
        Kept::new(config.stage(setup).unwrap(), Some(path.to_owned()))
    }

    #[test]
    fn what_was_learnt_is_there_after_a_restart() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("learnt.yaml");
        let mut first = kept(&path);
        for i in 0..1000_i32 {
            let mut sample = TwinState {
                header: Header {
                    stamp_ns: i64::from(i) * 2_000_000,
                    flags: flags::READY,
                    joint_count: 1,
                    ..Header::default()
                },
                ..TwinState::default()
            };
            sample.effort[0] = 0.3 * (f64::from(i) * 0.02).sin();
            first.accept(&sample, &mut Nowhere).unwrap();
        }
        assert!(!path.exists());
        first.finish(&mut Nowhere).unwrap();
        let learnt = first.stage.learnt().unwrap();
        assert!(learnt["joints"]["elbow"]["ident"].as_f64() > Some(0.0));
        assert_eq!(kept(&path).stage.learnt().unwrap(), learnt);
    }

    #[test]
    fn a_file_that_holds_something_else_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("learnt.yaml");
        std::fs::write(&path, "joints: {elbow: {ident: much}}\n").unwrap();
        let mut config = Config::of(Settings {
            state: Some(path),
            ..Settings::default()
        });
        assert!(resume(&mut config).is_err());
    }
}
