//! Which detectors there are, and how each comes to its settings: a line a detector.

use std::path::PathBuf;

use tauscope_detect::contact_tuning::Sweeps;
use tauscope_detect::{
    Config, LearnError, Lessons, Setup, contact_classifier, fisher_discriminant,
    frequency_classifier, lstm_momentum_observer, point_autoencoder, point_ocsvm, tauscope,
    virtual_collision_sensor, virtual_collision_sensor_basic, window_autoencoder, window_ocsvm,
};
use tauscope_pipeline::files::SetFile;
use tauscope_pipeline::trained;

use crate::recording::{Named, Role};

/// A detector that can be evaluated.
#[derive(Debug)]
pub struct Entry {
    /// Its canonical name.
    pub name: &'static str,
    /// Whether chance has a part in its training: then it is trained with [`SEEDS`] seeds.
    pub random: bool,
    /// What its training is.
    pub training: Training,
    /// Whether it runs on a set where nobody names detectors.
    pub usual: fn(Facts) -> bool,
    /// Trains or tunes it: what its part of a pipeline file would be.
    pub learn: fn(&Task<'_>) -> Result<Config, LearnError>,
    /// The curves behind what it has learnt, where it was tuned by some.
    pub sweeps: Option<Sweep>,
}

/// What the training of a detector is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Training {
    /// It has none.
    None,
    /// The fit of the twin's gains and offsets.
    Twin,
    /// Its own.
    Own,
}

/// The curves behind learnt settings.
pub type Sweep = fn(&Config, &Task<'_>) -> Result<Option<Sweeps>, LearnError>;

/// How many seeds a random detector is trained with.
pub const SEEDS: u64 = 5;

/// What there is to learn from.
#[derive(Debug)]
pub struct Task<'a> {
    /// The cell and its twin.
    pub setup: &'a Setup,
    /// Train and validation recordings behind the twin.
    pub lessons: Lessons<'a>,
    /// For so long nothing touches the robot at the beginning of each recording \[s\].
    pub free_first_s: f64,
    /// For what is drawn by chance.
    pub seed: u64,
    /// How long the fit of the twin took, if it was fitted \[s\].
    pub twin_fit_s: Option<f64>,
    /// What the set says of the detectors' settings.
    pub given: &'a Config,
    /// Where trained weights go; the ending is the detector's.
    pub weights: PathBuf,
}

impl Task<'_> {
    /// What all detectors share.
    fn shared(&self) -> Config {
        Config {
            threshold: self.given.threshold,
            hold_s: self.given.hold_s,
            ..Config::default()
        }
    }
}

/// What kind of set it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Facts {
    /// The train recordings tell collisions from cooperations.
    pub kinds: bool,
    /// The same cycle is repeated.
    pub cyclic: bool,
}

impl Facts {
    /// Of a set and its labels.
    pub fn of(set: &SetFile, recordings: &[Named]) -> Self {
        let train = (recordings.iter()).filter(|recording| recording.role == Role::Train);
        let events = train.filter_map(|recording| recording.truth.as_ref());
        let kinds: Vec<&str> = events
            .flat_map(|truth| &truth.events)
            .map(|event| event.kind.as_str())
            .collect();
        Self {
            kinds: kinds.contains(&"collision") && kinds.contains(&"cooperation"),
            cyclic: set.cycle_s.is_some(),
        }
    }
}

fn always(_: Facts) -> bool {
    true
}

/// Neither kinds nor a cycle: a robot on ever new paths.
fn is_plain(facts: Facts) -> bool {
    !facts.kinds && !facts.cyclic
}

fn tells_kinds(facts: Facts) -> bool {
    facts.kinds
}

/// A detector without chance that judges sample by sample and runs on every set.
const fn entry(name: &'static str, learn: fn(&Task<'_>) -> Result<Config, LearnError>) -> Entry {
    Entry {
        name,
        random: false,
        training: Training::Own,
        usual: always,
        learn,
        sweeps: None,
    }
}

/// A detector by the name of its module, which is its own: `given` has nothing to learn, `tuned` learns its
/// settings, `trained` weights that go to a file.
macro_rules! detector {
    (given $name:ident) => {
        Entry {
            training: Training::None,
            ..entry(stringify!($name), |task| {
                Ok(Config {
                    $name: Some(task.given.$name.clone().unwrap_or_default()),
                    ..task.shared()
                })
            })
        }
    };
    (tuned $name:ident) => {
        entry(stringify!($name), |task| {
            let settings = task.given.$name.clone().unwrap_or_default();
            let settings = $name::learn(&settings, task.setup, &task.lessons)?;
            Ok(Config {
                $name: Some(settings),
                ..task.shared()
            })
        })
    };
    (trained $name:ident) => {
        entry(stringify!($name), |task| {
            let mut settings = task.given.$name.clone().unwrap_or_default();
            let (lessons, seed) = (&task.lessons, task.seed);
            let trained = $name::train(&settings, task.setup, lessons, seed, &mut |_| ())?;
            settings.model = Some(trained::write(&task.weights, lessons, trained)?);
            Ok(Config {
                $name: Some(settings),
                ..task.shared()
            })
        })
    };
}

/// All of them, in the order of the tables.
pub static ENTRIES: &[Entry] = &[
    detector!(given naive_difference),
    detector!(given momentum_observer),
    Entry {
        training: Training::Twin,
        ..detector!(given twin_regression)
    },
    Entry {
        usual: is_plain,
        ..detector!(trained point_ocsvm)
    },
    Entry {
        random: true,
        usual: is_plain,
        ..detector!(trained point_autoencoder)
    },
    Entry {
        random: true,
        usual: is_plain,
        ..detector!(trained lstm_momentum_observer)
    },
    Entry {
        usual: is_plain,
        ..detector!(trained window_ocsvm)
    },
    Entry {
        random: true,
        usual: is_plain,
        ..detector!(trained window_autoencoder)
    },
    Entry {
        usual: |facts| facts.cyclic,
        ..detector!(tuned virtual_collision_sensor_basic)
    },
    Entry {
        usual: tells_kinds,
        sweeps: Some(|config, task| {
            let learnt = config.contact_classifier.as_ref();
            learnt
                .map(|learnt| contact_classifier::sweeps(learnt, task.setup, &task.lessons))
                .transpose()
        }),
        ..detector!(tuned contact_classifier)
    },
    Entry {
        usual: |facts| facts.cyclic,
        ..detector!(tuned virtual_collision_sensor)
    },
    Entry {
        usual: tells_kinds,
        ..detector!(tuned fisher_discriminant)
    },
    Entry {
        usual: tells_kinds,
        ..detector!(tuned frequency_classifier)
    },
    entry("tauscope", |task| {
        let mut settings = task.given.tauscope.clone().unwrap_or_default();
        if settings.offset_from_first_s <= 0.0 {
            settings.offset_from_first_s = task.free_first_s;
        }
        let settings = tauscope::learn(&settings, task.setup, &task.lessons)?;
        Ok(Config {
            tauscope: Some(settings),
            ..task.shared()
        })
    }),
];
