//! Folders of rosbag2 whose `metadata.yaml` does not fit.

#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::fs;
use std::path::Path;

use proptest::prelude::*;
use tauscope_archive::{ArchiveError, Compression, DamageKind, Recording};

use crate::bags::{metadata, split_bag};
use crate::common::{read_all, write};

/// Opens the bag, which has all its messages and one remark that nothing is lost; gives the remark.
fn remark(bag: &Path, messages: usize) -> String {
    let recording = Recording::open(bag).unwrap();
    assert_eq!(read_all(&recording).0.len(), messages);
    let [damage] = recording.damage() else {
        panic!("{:?}", recording.damage());
    };
    assert!(matches!(damage.kind, DamageKind::Index { .. }), "{damage}");
    damage.to_string()
}

#[test]
fn without_usable_metadata_the_folder_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let (bag, all) = split_bag(folder.path());
    for (text, says) in [
        (String::new(), "metadata.yaml is empty"),
        (" \n".to_owned(), "metadata.yaml is empty"),
        ("a: [".to_owned(), "metadata.yaml cannot be parsed: "),
        ("other: 1".to_owned(), "metadata.yaml cannot be parsed: "),
        (metadata(&[], "", ""), "metadata.yaml lists no files"),
        (
            metadata(&["x.mcap"], "", ""),
            "metadata.yaml lists x.mcap, which is not there",
        ),
        (
            metadata(&["bag_0.mcap", "x_1.mcap", "x_2.mcap"], "", ""),
            "metadata.yaml lists x_1.mcap and 1 more, which are not there",
        ),
    ] {
        fs::write(bag.join("metadata.yaml"), text).unwrap();
        let remark = remark(&bag, all.len());
        assert!(remark.contains(says), "{remark}");
    }
    fs::write(bag.join("metadata.yaml"), b"\xff\xfe\0").unwrap();
    assert!(remark(&bag, all.len()).contains("metadata.yaml cannot be read"));
    fs::remove_file(bag.join("metadata.yaml")).unwrap();
    assert!(remark(&bag, all.len()).contains("there is no metadata.yaml"));
}

#[test]
fn missing_files_are_reported_as_lost() {
    let folder = tempfile::tempdir().unwrap();
    let (bag, _) = split_bag(folder.path());
    // All that is there is listed.
    let files = ["bag_0.mcap", "bag_1.mcap", "bag_2.mcap", "bag_7.mcap"];
    fs::write(bag.join("metadata.yaml"), metadata(&files, "", "")).unwrap();
    let recording = Recording::open(&bag).unwrap();
    let [damage] = recording.damage() else {
        panic!("{:?}", recording.damage());
    };
    assert!(damage.to_string().contains("bag_7.mcap") && damage.loses_data());
    // More files are listed than there can have been renamed.
    let files = ["a_0.mcap", "a_1.mcap", "a_2.mcap", "a_3.mcap"];
    fs::write(bag.join("metadata.yaml"), metadata(&files, "", "")).unwrap();
    let recording = Recording::open(&bag).unwrap();
    let lost = recording.damage().iter().filter(|each| each.loses_data());
    assert_eq!((lost.count(), recording.damage().len()), (4, 5));
    // Nothing is there.
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    fs::write(empty.join("metadata.yaml"), metadata(&files, "", "")).unwrap();
    let error = Recording::open(&empty).err().unwrap();
    assert!(matches!(error, ArchiveError::UnknownFormat { .. }));
    let error = error.to_string();
    assert!(error.contains("without .mcap or .db3 files"), "{error}");
    assert!(error.contains("a_0.mcap and 3 more"), "{error}");
}

/// A random `metadata.yaml` listed the empty path, which was opened as the folder itself.
#[test]
fn a_folder_that_is_listed_as_a_file_is_not_there() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("bag_0.mcap"), Compression::None, 5);
    for listed in ["", ".", "/", ".."] {
        fs::write(
            folder.path().join("metadata.yaml"),
            metadata(&[listed], "", ""),
        )
        .unwrap();
        let recording = Recording::open(folder.path()).unwrap();
        assert_eq!(read_all(&recording).0.len(), 6, "{listed:?}");
    }
}

#[test]
fn messages_in_an_unknown_compression_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let text = metadata(&["bag_0.mcap"], "message", "lz4");
    fs::write(folder.path().join("metadata.yaml"), text).unwrap();
    let error = Recording::open(folder.path()).err().unwrap().to_string();
    assert!(error.contains("compressed as \"lz4\""), "{error}");
    assert!(error.contains("`ros2 bag convert`"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn no_metadata_makes_it_panic(
        text in prop_oneof![
            prop::collection::vec(any::<u8>(), 0..200),
            "[ -~\n]{0,200}".prop_map(String::into_bytes),
            "[ -~]{0,40}".prop_map(|file| metadata(&[&file], &file, "zstd").into_bytes()),
        ],
    ) {
        let folder = tempfile::tempdir().unwrap();
        write(&folder.path().join("bag_0.mcap"), Compression::None, 5);
        fs::write(folder.path().join("metadata.yaml"), text).unwrap();
        let recording = Recording::open(folder.path()).unwrap();
        prop_assert_eq!(read_all(&recording).0.len(), 6);
    }
}
