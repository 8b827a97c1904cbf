//! Learnt state of a detector: read from the file that its settings name, and kept from one run to the next.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread::JoinHandle;

use tauscope_bus::shell;
use tauscope_bus::{Detection, Emit, Stage, StageError, TwinState};
use tauscope_detect::{Config, Detect, State, StateFile};
use tauscope_watch::{Memory, Watch};

use crate::report::Report;
use crate::suggest;
use crate::yaml::{self, Place};
use tauscope_archive::whole_file::{self, Existing};

/// Interval between writes, in stream time \[ns\]. The state learnt since the last write is lost in a crash.
/// Resolution: disk writes, against the loss after a crash.
const WRITE_EVERY_NS: i64 = 10_000_000_000;

/// Resumes the state from the file that `config` names, if it exists. Returns the path of the file.
///
/// # Errors
/// All errors in the file.
pub fn resume(config: &mut Config) -> Result<Option<PathBuf>, Report> {
    let path = config.state_mut().cloned();
    if let Some(path) = path.as_ref().filter(|path| path.exists()) {
        let state = yaml::load::<StateFile>(path)?;
        let resumed = config.resume(&state.value.0);
        resumed.map_err(|error| state.at(&Place::root(), error.to_string()))?;
    }
    Ok(path)
}

/// Reads the learnt state of a watch from the file at `path`, if it exists.
///
/// # Errors
/// All errors in the file.
pub fn of_watch(path: &Path, joints: usize) -> Result<Option<Memory>, Report> {
    if !path.exists() {
        return Ok(None);
    }
    let memory = yaml::load::<Memory>(path)?;
    if !memory.value.fits(joints) {
        let problem =
            "this is not the learnt state of a watch for a robot with this number of joints";
        return Err(memory.at(&Place::root(), problem).into());
    }
    Ok(Some(memory.value))
}

/// Replaces the path of a file of learnt state in `config`, if there is one, by the content of the file. Such a file
/// is `learnt.yaml` as `init` and `evaluate` write it: for each detector its part of a pipeline file.
///
/// # Errors
/// All errors in the file.
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
        let problem = file.at(&place, format!("no learnt state of {name}"));
        let help = format!(
            "this file holds the learnt state of: {}",
            suggest::list(learned.map(|(name, _)| name.as_str()))
        );
        return Err(problem.help(help).into());
    };
    let place = place.key(name).key("learnt");
    (config.resume(&learnt)).map_err(|error| file.at(&place, error.to_string()).into())
}

/// A stage that learns during operation.
pub trait Learns: Stage<TwinState, Detection> {
    /// Learnt state, for the next start of the stage; `None` if there is none.
    fn learnt(&self) -> Option<State>;

    /// Whether it is learning now, so that its state is incomplete.
    fn is_learning(&self) -> bool;
}

impl Learns for Detect {
    fn learnt(&self) -> Option<State> {
        Self::learnt(self)
    }

    fn is_learning(&self) -> bool {
        Self::is_learning(self)
    }
}

impl Learns for Watch {
    fn learnt(&self) -> Option<State> {
        serde_json::to_value(Self::learnt(self)?).ok()
    }

    fn is_learning(&self) -> bool {
        Self::is_learning(self)
    }
}

/// A stage whose learnt state is written to a file: when learning ends, at regular intervals, and at the end. Nothing
/// is written during learning, so a stage that crashes then starts to learn again. Its stream is unchanged.
pub struct Kept<S> {
    stage: S,
    keeper: Option<Keeper>,
}

impl<S: Learns> Kept<S> {
    /// Wraps `stage`, whose state is kept at `path`, if given.
    pub fn new(stage: S, path: Option<PathBuf>) -> Self {
        let was_learning = stage.is_learning();
        Self {
            stage,
            keeper: path.map(|path| Keeper::new(path, was_learning)),
        }
    }
}

impl<S: Learns> Stage<TwinState, Detection> for Kept<S> {
    fn accept(
        &mut self,
        sample: &TwinState,
        out: &mut dyn Emit<Detection>,
    ) -> Result<(), StageError> {
        self.stage.accept(sample, out)?;
        let Some(keeper) = &mut self.keeper else {
            return Ok(());
        };
        keeper.check()?;
        if keeper.is_due(sample.header.stamp_ns, self.stage.is_learning())
            && let Some(learnt) = self.stage.learnt()
        {
            keeper.write(learnt);
        }
        Ok(())
    }

    fn finish(&mut self, out: &mut dyn Emit<Detection>) -> Result<(), StageError> {
        self.stage.finish(out)?;
        let Some(keeper) = self.keeper.take() else {
            return Ok(());
        };
        let learnt = self.stage.learnt();
        keeper.end(learnt.filter(|_| !self.stage.is_learning()))
    }

    fn dropped(&self) -> u64 {
        self.stage.dropped()
    }
}

/// Reports that a stage restarted this often has lost what it had learnt, if no state was saved.
pub fn tell_what_is_lost(stage: &str, restarts: u64, kept: Option<&Path>) {
    if restarts > 0 && kept.is_none_or(|path| !path.exists()) {
        let how = match kept {
            Some(_) => "nothing was kept yet",
            None => "`state: FILE` keeps it",
        };
        let lost = format!("started again: what it had learnt is lost; {how}");
        shell::note(stage, &lost);
    }
}

/// Writes the file in a separate thread, so that no sample waits for the disk.
struct Keeper {
    path: PathBuf,
    written_ns: Option<i64>,
    was_learning: bool,
    to_write: SyncSender<State>,
    writer: JoinHandle<()>,
    failures: Receiver<String>,
}

impl Keeper {
    fn new(path: PathBuf, was_learning: bool) -> Self {
        let (to_write, waiting) = mpsc::sync_channel::<State>(1);
        let (failed, failures) = mpsc::channel();
        let file = path.clone();
        let writer = std::thread::spawn(move || {
            for learnt in waiting {
                if let Err(error) = write(&file, &learnt)
                    && failed.send(error).is_err()
                {
                    return;
                }
            }
        });
        Self {
            path,
            written_ns: None,
            was_learning,
            to_write,
            writer,
            failures,
        }
    }

    /// Whether the state at the sample with this stamp must be written.
    fn is_due(&mut self, stamp_ns: i64, is_learning: bool) -> bool {
        let ended = std::mem::replace(&mut self.was_learning, is_learning) && !is_learning;
        let written_ns = *self.written_ns.get_or_insert(stamp_ns);
        let due = ended || !(0..WRITE_EVERY_NS).contains(&(stamp_ns - written_ns));
        if due {
            self.written_ns = Some(stamp_ns);
        }
        due && !is_learning
    }

    /// Queues the state for writing. If the previous write is still in progress, the next state is due at once.
    fn write(&mut self, learnt: State) {
        if self.to_write.try_send(learnt).is_err() {
            self.written_ns = self.written_ns.map(|ns| ns - WRITE_EVERY_NS);
        }
    }

    /// Returns the error of a failed write.
    fn check(&self) -> Result<(), StageError> {
        match self.failures.try_recv() {
            Ok(error) => Err(failed(&self.path, &error)),
            Err(_) => Ok(()),
        }
    }

    /// Waits for pending writes, then writes the final state.
    fn end(self, learnt: Option<State>) -> Result<(), StageError> {
        let Self {
            path,
            to_write,
            writer,
            ..
        } = self;
        drop(to_write);
        // A panic of the writer does not matter, because the final state is written next.
        let _ = writer.join();
        let Some(learnt) = learnt else {
            return Ok(());
        };
        write(&path, &learnt).map_err(|error| failed(&path, &error))
    }
}

fn failed(path: &Path, error: &str) -> StageError {
    let path = path.display();
    StageError::failed(format!("cannot keep what was learnt in {path}: {error}"))
}

fn write(path: &Path, learnt: &State) -> Result<(), String> {
    let text = serde_saphyr::to_string(learnt).map_err(|error| error.to_string())?;
    whole_file::write(path, text, Existing::Replace).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

    use tauscope_bus::{Header, LinkError, flags};
    use tauscope_detect::indri::virtual_collision_sensor::{FirstBias, Learn, Settings};
    use tauscope_detect::{JointSetup, Setup};

    use super::*;

    struct Nowhere;

    impl Emit<Detection> for Nowhere {
        fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
            write(&mut Detection::default());
            Ok(())
        }
    }

    fn kept(path: &Path) -> Kept<Detect> {
        kept_by(
            path,
            Settings {
                bias: Some(FirstBias::InOrder(vec![1.0])),
                ..Settings::default()
            },
        )
    }

    fn kept_by(path: &Path, settings: Settings) -> Kept<Detect> {
        let mut config = Config::of(Settings {
            state: Some(path.to_owned()),
            ..settings
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

    fn run(stage: &mut Kept<Detect>, samples: std::ops::Range<i32>) {
        for i in samples {
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
            stage.accept(&sample, &mut Nowhere).unwrap();
        }
    }

    /// Waits until the writer thread has created the file.
    fn appears(path: &Path) -> bool {
        (0..200).any(|_| {
            std::thread::sleep(std::time::Duration::from_millis(10));
            path.exists()
        })
    }

    #[test]
    fn what_was_learnt_is_there_as_learning_ends_and_not_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("learnt.yaml");
        let settings = Settings {
            bias: Some(FirstBias::InOrder(vec![1.0])),
            learn: Learn::AtStart,
            learning_s: 15.0,
            ..Settings::default()
        };
        // No orderly end, as in a killed process.
        let mut killed = kept_by(&path, settings);
        run(&mut killed, 0..7000);
        assert!(!path.exists(), "it learns; ten seconds have passed");
        run(&mut killed, 7000..8000);
        assert!(appears(&path), "it has learnt");
        std::fs::remove_file(&path).unwrap();
        run(&mut killed, 8000..14_000);
        assert!(appears(&path), "again at short intervals");
    }

    #[test]
    fn what_was_learnt_is_there_after_a_restart() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("learnt.yaml");
        let mut first = kept(&path);
        run(&mut first, 0..1000);
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
