//! The short form of the fuzzing: every kept input, and mutations of them for a few seconds. `tests/fuzz/run.sh` is
//! the long one.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::{Config, TestRng, TestRunner};
use tauscope_fuzz::{TARGETS, Take};

/// Duration of fuzzing per target.
/// Resolution: time of the tests.
const FOR: Duration = Duration::from_secs(3);

/// Change of an input, at a place from 0 (its beginning) to 1.
#[derive(Debug, Clone)]
enum Change {
    Byte(f64, u8),
    Number(f64, u64),
    Insert(f64, Vec<u8>),
    Copy(f64, f64, usize),
    Remove(f64, usize),
    Cut(f64),
}

fn change() -> impl Strategy<Value = Change> {
    let at = || 0.0..1.0;
    let numbers = [0, 1, u64::MAX, 1 << 63, 1 << 40, 0xffff_ffff, 0x7fff_ffff];
    prop_oneof![
        (at(), any::<u8>()).prop_map(|(at, byte)| Change::Byte(at, byte)),
        (at(), prop::sample::select(numbers.to_vec())).prop_map(|(at, n)| Change::Number(at, n)),
        (at(), prop::collection::vec(any::<u8>(), 1..8)).prop_map(|(at, b)| Change::Insert(at, b)),
        (at(), at(), 1_usize..64).prop_map(|(from, to, len)| Change::Copy(from, to, len)),
        (at(), 1_usize..64).prop_map(|(at, len)| Change::Remove(at, len)),
        at().prop_map(Change::Cut),
    ]
}

impl Change {
    fn apply(&self, bytes: &mut Vec<u8>) {
        let place = |at: f64, bytes: &[u8]| (at * bytes.len() as f64) as usize;
        match self {
            Self::Byte(at, byte) => {
                let at = place(*at, bytes);
                if let Some(old) = bytes.get_mut(at) {
                    *old = *byte;
                }
            }
            Self::Number(at, number) => {
                let at = place(*at, bytes);
                for (old, new) in bytes.iter_mut().skip(at).zip(number.to_le_bytes()) {
                    *old = new;
                }
            }
            Self::Insert(at, more) => {
                let at = place(*at, bytes);
                bytes.splice(at..at, more.iter().copied());
            }
            Self::Copy(from, to, len) => {
                let (from, to) = (place(*from, bytes), place(*to, bytes));
                let part = bytes[from..bytes.len().min(from + len)].to_vec();
                bytes.splice(to..to, part);
            }
            Self::Remove(at, len) => {
                let at = place(*at, bytes);
                bytes.drain(at..bytes.len().min(at + len));
            }
            Self::Cut(at) => bytes.truncate(place(*at, bytes)),
        }
    }
}

fn corpus(name: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("corpus")
        .join(name);
    let mut paths: Vec<_> = fs::read_dir(&folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.sort();
    assert!(!paths.is_empty(), "{} is empty", folder.display());
    paths.iter().map(|path| fs::read(path).unwrap()).collect()
}

fn survives(name: &str, take: Take) {
    let corpus = corpus(name);
    for input in &corpus {
        take(input);
    }
    let mutated = (
        prop::sample::select(corpus),
        prop::collection::vec(change(), 1..6),
    );
    let mutated = mutated.prop_map(|(mut bytes, changes)| {
        for change in &changes {
            change.apply(&mut bytes);
        }
        bytes
    });
    let config = Config::default();
    let rng = TestRng::deterministic_rng(config.rng_algorithm);
    let mut runner = TestRunner::new_with_rng(config, rng);
    let until = Instant::now() + FOR;
    while Instant::now() < until {
        let input = mutated.new_tree(&mut runner).unwrap().current();
        let taken = std::panic::catch_unwind(|| take(&input));
        assert!(taken.is_ok(), "{name}: {}", input.escape_ascii());
    }
}

macro_rules! short {
    ($($name:ident),+ $(,)?) => {
        $(#[test]
        fn $name() {
            let name = stringify!($name);
            let target = TARGETS.iter().find(|target| target.name == name).unwrap();
            survives(name, target.take);
        })+

        #[test]
        fn every_target_is_tried() {
            assert_eq!(TARGETS.map(|target| target.name), [$(stringify!($name)),+]);
        }
    };
}

short!(
    bus_samples,
    cdr,
    command,
    csv,
    lerobot,
    mcap,
    modbus,
    pipeline,
    ros1_bag,
    status,
    twin,
    urdf
);
