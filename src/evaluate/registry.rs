//! Which detectors there are, and how each comes to its settings: a line a detector.

use std::path::PathBuf;

use tauscope_detect::{
    Config, LearnError, Lessons, Setup, contact_classifier, fisher_discriminant,
    frequency_classifier, lstm_momentum_observer, momentum_observer, naive_difference,
    point_autoencoder, point_ocsvm, tauscope, twin_regression, virtual_collision_sensor,
    virtual_collision_sensor_basic, window_autoencoder, window_ocsvm,
};

use super::input::{Named, Role};
use crate::files::SetFile;
use crate::trained;

/// A detector that can be evaluated.
#[derive(Debug)]
pub struct Entry {
    /// Its canonical name.
    pub name: &'static str,
    /// Whether chance has a part in its training: then it is trained with [`SEEDS`] seeds.
    pub random: bool,
    /// How many samples it judges at once, for one that judges windows.
    pub window: Option<usize>,
    /// Whether it runs on a set where nobody names detectors.
    pub usual: fn(Facts) -> bool,
    /// Trains or tunes it: what its part of a pipeline file would be.
    pub learn: fn(&Task<'_>) -> Result<Config, LearnError>,
}

/// How many seeds a random detector is trained with.
pub const SEEDS: u64 = 5;

/// What there is to learn from.
#[derive(Debug)]
pub struct Task<'a> {
    /// The cell and its twin.
    pub setup: &'a Setup,
    /// Train and validation recordings behind the twin.
    pub lessons: Lessons<'a>,
    /// For what is drawn by chance.
    pub seed: u64,
    /// Where trained weights go; the ending is the detector's.
    pub weights: PathBuf,
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

/// All of them, in the order of the tables.
pub static ENTRIES: &[Entry] = &[
    Entry {
        name: "naive_difference",
        random: false,
        window: None,
        usual: always,
        learn: |_| {
            Ok(Config {
                naive_difference: Some(naive_difference::Settings::default()),
                ..Config::default()
            })
        },
    },
    Entry {
        name: "momentum_observer",
        random: false,
        window: None,
        usual: always,
        learn: |_| {
            Ok(Config {
                momentum_observer: Some(momentum_observer::Settings::default()),
                ..Config::default()
            })
        },
    },
    Entry {
        name: "twin_regression",
        random: false,
        window: None,
        usual: always,
        learn: |_| {
            Ok(Config {
                twin_regression: Some(twin_regression::Settings::default()),
                ..Config::default()
            })
        },
    },
    Entry {
        name: point_ocsvm::NAME,
        random: false,
        window: None,
        usual: is_plain,
        learn: |task| {
            let mut settings = point_ocsvm::Settings::default();
            let trained =
                point_ocsvm::train(&settings, task.setup, &task.lessons, task.seed, &mut |_| ())?;
            settings.model = Some(trained::write(&task.weights, &task.lessons, trained)?);
            Ok(Config {
                point_ocsvm: Some(settings),
                ..Config::default()
            })
        },
    },
    Entry {
        name: point_autoencoder::NAME,
        random: true,
        window: None,
        usual: is_plain,
        learn: |task| {
            let mut settings = point_autoencoder::Settings::default();
            let trained = point_autoencoder::train(
                &settings,
                task.setup,
                &task.lessons,
                task.seed,
                &mut |_| (),
            )?;
            settings.model = Some(trained::write(&task.weights, &task.lessons, trained)?);
            Ok(Config {
                point_autoencoder: Some(settings),
                ..Config::default()
            })
        },
    },
    Entry {
        name: lstm_momentum_observer::NAME,
        random: true,
        window: None,
        usual: is_plain,
        learn: |task| {
            let mut settings = lstm_momentum_observer::Settings::default();
            let trained = lstm_momentum_observer::train(
                &settings,
                task.setup,
                &task.lessons,
                task.seed,
                &mut |_| (),
            )?;
            settings.model = Some(trained::write(&task.weights, &task.lessons, trained)?);
            Ok(Config {
                lstm_momentum_observer: Some(settings),
                ..Config::default()
            })
        },
    },
    Entry {
        name: window_ocsvm::NAME,
        random: false,
        window: Some(16),
        usual: is_plain,
        learn: |task| {
            let mut settings = window_ocsvm::Settings::default();
            let trained =
                window_ocsvm::train(&settings, task.setup, &task.lessons, task.seed, &mut |_| ())?;
            settings.model = Some(trained::write(&task.weights, &task.lessons, trained)?);
            Ok(Config {
                window_ocsvm: Some(settings),
                ..Config::default()
            })
        },
    },
    Entry {
        name: window_autoencoder::NAME,
        random: true,
        window: Some(16),
        usual: is_plain,
        learn: |task| {
            let mut settings = window_autoencoder::Settings::default();
            let trained = window_autoencoder::train(
                &settings,
                task.setup,
                &task.lessons,
                task.seed,
                &mut |_| (),
            )?;
            settings.model = Some(trained::write(&task.weights, &task.lessons, trained)?);
            Ok(Config {
                window_autoencoder: Some(settings),
                ..Config::default()
            })
        },
    },
    Entry {
        name: "virtual_collision_sensor_basic",
        random: false,
        window: None,
        usual: |facts| facts.cyclic,
        learn: |task| {
            let settings = virtual_collision_sensor_basic::Settings::default();
            let settings =
                virtual_collision_sensor_basic::learn(&settings, task.setup, &task.lessons)?;
            Ok(Config {
                virtual_collision_sensor_basic: Some(settings),
                ..Config::default()
            })
        },
    },
    Entry {
        name: "contact_classifier",
        random: false,
        window: None,
        usual: tells_kinds,
        learn: |task| {
            let settings = contact_classifier::Settings::default();
            Ok(Config {
                contact_classifier: Some(contact_classifier::learn(
                    &settings,
                    task.setup,
                    &task.lessons,
                )?),
                ..Config::default()
            })
        },
    },
    Entry {
        name: "virtual_collision_sensor",
        random: false,
        window: None,
        usual: |facts| facts.cyclic,
        learn: |task| {
            let settings = virtual_collision_sensor::Settings::default();
            let settings = virtual_collision_sensor::learn(&settings, task.setup, &task.lessons)?;
            Ok(Config {
                virtual_collision_sensor: Some(settings),
                ..Config::default()
            })
        },
    },
    Entry {
        name: "fisher_discriminant",
        random: false,
        window: None,
        usual: tells_kinds,
        learn: |task| {
            let settings = fisher_discriminant::Settings::default();
            Ok(Config {
                fisher_discriminant: Some(fisher_discriminant::learn(
                    &settings,
                    task.setup,
                    &task.lessons,
                )?),
                ..Config::default()
            })
        },
    },
    Entry {
        name: "frequency_classifier",
        random: false,
        window: None,
        usual: tells_kinds,
        learn: |task| {
            let settings = frequency_classifier::Settings::default();
            Ok(Config {
                frequency_classifier: Some(frequency_classifier::learn(
                    &settings,
                    task.setup,
                    &task.lessons,
                )?),
                ..Config::default()
            })
        },
    },
    Entry {
        name: "tauscope",
        random: false,
        window: None,
        usual: always,
        learn: |task| {
            let settings = tauscope::learn(&tauscope::Settings::default(), &task.lessons)?;
            Ok(Config {
                tauscope: Some(settings),
                ..Config::default()
            })
        },
    },
];
