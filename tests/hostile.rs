//! Malicious files end with a clear error, soon and in bounded memory.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]
#![allow(unsafe_code, reason = "an allocator that watches what is asked for")]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use common::{Out, bundled, write};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tauscope_archive::ros::{self, JointState};
use tauscope_archive::{Recording, repair};
use tauscope_dynamics::Model;

/// Largest single allocation \[bytes\].
static LARGEST: AtomicUsize = AtomicUsize::new(0);

struct Watched;

// SAFETY: all calls are passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Watched {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promises are those that the system's allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        LARGEST.fetch_max(size, Ordering::Relaxed);
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Watched = Watched;

/// Largest allowed allocation: the decompressed size of an archive's chunk, plus a margin.
const MOST_BYTES: usize = (1 << 30) + (64 << 20);

/// Changes up to six bytes, or a whole number; truncates occasionally.
fn mutated(original: &[u8], chance: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = original.to_vec();
    for _ in 0..chance.random_range(1..6) {
        let at = chance.random_range(0..bytes.len());
        match chance.random_range(0..4) {
            0 => bytes[at] = chance.random(),
            1 => bytes[at] ^= 1 << chance.random_range(0..8),
            2 if at + 8 <= bytes.len() => {
                let wide = [u64::MAX, 1 << 63, 1 << 40, u64::from(u32::MAX), 0];
                let value = wide[chance.random_range(0..wide.len())];
                bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
            }
            _ => bytes.insert(at, bytes[at]),
        }
    }
    if chance.random_bool(0.2) {
        bytes.truncate(chance.random_range(0..bytes.len()));
    }
    bytes
}

/// Passes `count` mutations of `original` to `take`; none may panic or allocate much memory.
fn survive(name: &str, original: &[u8], count: usize, mut take: impl FnMut(&[u8])) {
    let mut chance = ChaCha8Rng::seed_from_u64(18);
    for n in 0..count {
        take(&mutated(original, &mut chance));
        let largest = LARGEST.load(Ordering::Relaxed);
        assert!(largest <= MOST_BYTES, "{name} {n}: {largest} bytes at once");
    }
}

/// A small archive: one tenth of a second of joint states.
fn small_archive(folder: &Path) -> Vec<u8> {
    let provenance = [("made_by".to_owned(), "a test".to_owned())].into();
    let path = folder.join("small.mcap");
    let none = tauscope_archive::Compression::None;
    let mut writer = tauscope_archive::McapWriter::create(&path, none, &provenance).unwrap();
    let topic = writer.add_topic::<JointState>("/joint_states").unwrap();
    for k in 0..30 {
        writer.write(topic, k, k, &joint_state()).unwrap();
    }
    fs::read(writer.finish().unwrap().path).unwrap()
}

fn joint_state() -> JointState {
    JointState {
        header: ros::Header::new(7, "base"),
        name: vec!["shoulder".to_owned(), "elbow".to_owned()],
        position: vec![0.1, 0.2],
        velocity: vec![0.3, 0.4],
        effort: vec![5.0, 6.0],
    }
}

#[test]
fn no_mutation_of_an_archive_harms() {
    let folder = tempfile::tempdir().unwrap();
    let original = small_archive(folder.path());
    let path = folder.path().join("a.mcap");
    let mut count = 0;
    survive("MCAP", &original, 3000, |bytes| {
        count += 1;
        fs::write(&path, bytes).unwrap();
        let Ok(recording) = Recording::open(&path) else {
            return;
        };
        let mut messages = recording.all_messages().unwrap();
        while let Some(message) = messages.next_message() {
            let _ = message.map(|message| message.decode::<JointState>());
        }
        // A repair waits for the disk, so it is run rarely.
        if count % 10 != 0 {
            return;
        }
        let to = folder.path().join("repaired.mcap");
        let _ = repair(&[&path], &to);
        let _ = fs::remove_file(&to);
    });
}

#[test]
fn no_mutation_of_a_message_harms() {
    let mut original = Vec::new();
    ros::encode(&joint_state(), &mut original).unwrap();
    survive("CDR", &original, 20_000, |bytes| {
        let _ = ros::decode::<JointState>(bytes);
        let _ = ros::decode::<ros::DiagnosticArray>(bytes);
        let _ = ros::decode::<ros::WrenchStamped>(bytes);
    });
}

#[test]
fn no_mutation_of_a_table_harms() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let mut original = "time,q_0,q_1,effort_0,effort_1\n".to_owned();
    for k in 0..20 {
        original += &format!("{}.00{k},0.1,0.2,3.5,-4e-1\n", k / 10);
    }
    survive("CSV", original.as_bytes(), 2000, |bytes| {
        fs::write(&path, bytes).unwrap();
        if let Ok(recording) = Recording::open(&path) {
            let mut messages = recording.all_messages().unwrap();
            while messages
                .next_message()
                .is_some_and(|message| message.is_ok())
            {}
        }
    });
}

#[test]
fn no_mutation_of_a_file_that_people_write_harms() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file.yaml");
    let pipeline = fs::read(common::root().join("pipeline.yaml")).unwrap();
    let twin = fs::read(bundled().join("demo.twin.yaml")).unwrap();
    for (kind, original, count) in [("pipeline", pipeline, 1000), ("twin", twin, 500)] {
        survive(kind, &original, count, |bytes| {
            fs::write(&path, bytes).unwrap();
            let path = path.to_str().unwrap();
            let checked = Out::answer(["check", path, "--kind", kind]);
            assert!(matches!(checked.code, 0 | 2), "{}", checked.stderr);
        });
    }
}

#[test]
fn no_mutation_of_a_robot_harms() {
    let original = fs::read(bundled().join("demo_arm.urdf")).unwrap();
    survive("URDF", &original, 2000, |bytes| {
        let _ = Model::from_urdf(&String::from_utf8_lossy(bytes));
    });
}

/// Asserts that the input of `make` is refused with these words, and soon.
fn refused_soon(words: &str, make: impl FnOnce() -> String) {
    let begun = Instant::now();
    let said = make();
    let took = begun.elapsed();
    assert!(said.contains(words), "{}", &said[..said.len().min(2000)]);
    // Without the limit it took minutes.
    assert!(took < Duration::from_secs(20), "{took:?}");
}

fn model_error(urdf: &str) -> String {
    Model::from_urdf(urdf).map_or_else(|error| error.to_string(), |_| String::new())
}

#[test]
fn a_robot_that_is_none_is_refused_with_the_limit() {
    refused_soon("more than 2000, which is the limit", || {
        let mut urdf = "<robot name=\"chain\"><link name=\"l0\"/>".to_owned();
        for n in 1..20_000 {
            urdf += &format!(
                "<link name=\"l{n}\"/><joint name=\"j{n}\" type=\"revolute\"><parent link=\"l{}\"/>\
                 <child link=\"l{n}\"/><limit effort=\"1\" velocity=\"1\"/></joint>\n",
                n - 1
            );
        }
        model_error(&(urdf + "</robot>"))
    });
    for deep in [90_000, 200_000] {
        refused_soon("which is the limit", || {
            let urdf = "<a>".repeat(deep) + &"</a>".repeat(deep);
            model_error(&format!("<robot name=\"deep\">{urdf}</robot>"))
        });
    }
    refused_soon("which is the limit", || {
        model_error(&("<robot name=\"large\">".to_owned() + &" ".repeat(20 << 20) + "</robot>"))
    });
    // Half a gigabyte of zeros in a sparse file.
    let folder = tempfile::tempdir().unwrap();
    let urdf = folder.path().join("large.urdf");
    fs::File::create(&urdf).unwrap().set_len(500 << 20).unwrap();
    let text = "version: 1\ncells: {a: {robot: large.urdf}}\n\
                stages:\n- {name: x, ingest: {zenoh: {connect: [tcp/127.0.0.1:7447]}}}\n";
    let file = write(&folder.path().join("pipeline.yaml"), text);
    refused_soon("the limit is 16777216", || {
        Out::answer([Path::new("check"), &file]).stderr
    });
}

#[test]
fn a_pipeline_without_end_is_refused_with_the_limit() {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(
        bundled().join("demo_arm.urdf"),
        folder.path().join("a.urdf"),
    )
    .unwrap();
    let file = folder.path().join("pipeline.yaml");
    let check = |text: &str| {
        fs::write(&file, text).unwrap();
        Out::answer([Path::new("check"), &file]).stderr
    };
    refused_soon("more than 20000 mappings, which is the limit", || {
        let cells: Vec<_> = (0..120_000)
            .map(|n| format!(" c{n}: {{robot: a.urdf}}"))
            .collect();
        check(&format!(
            "version: 1\ncells:\n{}\nstages: []\n",
            cells.join("\n")
        ))
    });
    refused_soon("more than 20000 mappings, which is the limit", || {
        check(&format!(
            "version: 1\nstages:\n{}",
            "- {nmae: x, twin: {}}\n".repeat(40_000)
        ))
    });
    refused_soon("and 180 more", || {
        check(&format!(
            "version: 1\nstages:\n{}",
            "- {nmae: x, twin: {}}\n".repeat(5000)
        ))
    });
}
