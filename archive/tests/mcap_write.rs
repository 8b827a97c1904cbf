//! Output of `McapWriter`.

use std::collections::BTreeMap;
use std::fs;

use crate::common::{PERIOD_NS, START_NS, read_all, state, write};
use tauscope_archive::ros::{self, JointState, Message};
use tauscope_archive::{CHUNK_SPAN_NS, Compression, McapWriter, Recording};

const ALL: [Compression; 3] = [Compression::Zstd, Compression::Lz4, Compression::None];

#[test]
fn what_was_written_is_read() {
    let folder = tempfile::tempdir().unwrap();
    for compression in ALL {
        let path = write(&folder.path().join("a.mcap"), compression, 100);
        let recording = Recording::open(path).unwrap();
        assert!(recording.damage().is_empty());
        assert_eq!(recording.message_count(), 110);
        assert_eq!(recording.start_ns(), Some(START_NS + 5));
        assert_eq!(recording.end_ns(), Some(START_NS + 99 * PERIOD_NS + 5));
        assert_eq!(
            recording.topics()[0].type_hash.as_deref(),
            Some(JointState::TYPE_HASH)
        );
        let mut states = recording.joint_states("/joint_states").unwrap();
        for i in 0..100 {
            let read = states.next_state().unwrap().unwrap();
            assert_eq!(read.log_time_ns, START_NS + i * PERIOD_NS + 5);
            assert_eq!(read.publish_time_ns, START_NS + i * PERIOD_NS);
            let expected = state(i);
            assert_eq!(read.message.position, expected.position);
            assert_eq!(read.message.name, expected.name);
            assert!(read.message.effort[1].is_nan());
        }
        assert!(states.next_state().is_none());
    }
}

#[test]
fn the_same_calls_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    for compression in ALL {
        let bytes: Vec<_> = (0..8)
            .map(|_| {
                let path = write(&folder.path().join("a.mcap"), compression, 40);
                let bytes = fs::read(&path).unwrap();
                fs::remove_file(path).unwrap();
                bytes
            })
            .collect();
        assert!(bytes.windows(2).all(|pair| pair[0] == pair[1]));
    }
}

#[test]
fn the_mcap_crate_finds_the_summary_sound() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(&folder.path().join("a.mcap"), Compression::Zstd, 40);
    let bytes = fs::read(path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.stats.unwrap().message_count, 44);
    assert_eq!(mcap::MessageStream::new(&bytes).unwrap().count(), 44);
    let options = mcap::sans_io::linear_reader::LinearReaderOptions::default()
        .with_validate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let mut reader = mcap::sans_io::linear_reader::LinearReader::new_with_options(options);
    let mut left = bytes.as_slice();
    while let Some(event) = reader.next_event() {
        if let mcap::sans_io::linear_reader::LinearReadEvent::ReadRequest(need) = event.unwrap() {
            let take = need.min(left.len());
            reader.insert(need)[..take].copy_from_slice(&left[..take]);
            reader.notify_read(take);
            left = &left[take..];
        }
    }
    assert!(left.is_empty());
}

#[test]
fn chunks_span_less_than_a_tenth_of_a_second() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(&folder.path().join("a.mcap"), Compression::Zstd, 100);
    let bytes = fs::read(path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.chunk_indexes.len(), 10);
    for chunk in summary.chunk_indexes {
        assert!(chunk.message_end_time - chunk.message_start_time < CHUNK_SPAN_NS as u64);
    }
}

#[test]
fn an_unfinished_file_is_a_part_that_holds_all_but_the_open_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deeper/a.mcap");
    let mut writer = McapWriter::create(&path, Compression::Zstd, &BTreeMap::new()).unwrap();
    let states = writer.add_topic::<JointState>("/joint_states").unwrap();
    for i in 0..25 {
        let ns = START_NS + i * PERIOD_NS;
        writer.write(states, ns, ns, &state(i)).unwrap();
    }
    let part = folder.path().join("deeper/a.mcap.part");
    assert!(!path.exists());
    // The file that a killed writer leaves: a copy taken while the writer is running.
    let copy = folder.path().join("copy.mcap.part");
    fs::copy(&part, &copy).unwrap();
    let recording = Recording::open(&copy).unwrap();
    assert_eq!(read_all(&recording).0.len(), 20);
    assert_eq!(recording.damage().len(), 1);

    writer.flush().unwrap();
    fs::copy(&part, &copy).unwrap();
    let recording = Recording::open(&copy).unwrap();
    assert_eq!(read_all(&recording).0.len(), 25);

    writer.finish().unwrap();
    assert!(path.exists() && !part.exists());
}

#[test]
fn a_part_of_a_dead_writer_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    for n in 1..=2 {
        fs::write(folder.path().join("a.mcap.part"), format!("{n}")).unwrap();
        let writer = McapWriter::create(&path, Compression::Zstd, &BTreeMap::new()).unwrap();
        let aside = writer.set_aside().unwrap().to_owned();
        assert_eq!(aside, folder.path().join(format!("a.{n}.mcap.part")));
        assert_eq!(fs::read_to_string(aside).unwrap(), format!("{n}"));
        writer.finish().unwrap();
    }
}

#[test]
fn a_time_before_the_epoch_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut writer = McapWriter::create(path, Compression::Zstd, &BTreeMap::new()).unwrap();
    let topic = writer.add_topic::<ros::Bool>("/contact").unwrap();
    let error = writer.write(topic, -1, 0, &ros::Bool { data: true });
    assert!(error.unwrap_err().to_string().contains("/contact"));
}
