//! Zero copy: the reader gets the slot that the stage has filled.

// Helpers outside a test function.
#![allow(clippy::unwrap_used)]

use std::time::Duration;

use tauscope_bus::seat::{AnyReceiver, AnySender};
use tauscope_bus::shell::{self, Context, Ends, Input, Node};
use tauscope_bus::{
    Audience, Domain, Emit, InProcess, JointState, Keep, Received, Receiver, Sender, SharedMemory,
    Stage, StageError, Transport, TwinState,
};

const LONG: Duration = Duration::from_secs(20);

/// A twin that remembers where it wrote.
#[derive(Default)]
struct Twin {
    wrote: Vec<Place>,
    place_of: Option<fn(&TwinState) -> Place>,
}

impl Stage<JointState, TwinState> for Twin {
    fn accept(
        &mut self,
        sample: &JointState,
        out: &mut dyn Emit<TwinState>,
    ) -> Result<(), StageError> {
        out.emit(&mut |twin| {
            twin.header.stamp_ns = sample.header.stamp_ns;
            twin.residual[0] = sample.effort[0];
            self.wrote.extend(self.place_of.map(|place| place(twin)));
        })?;
        Ok(())
    }
}

/// A location in memory.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Place {
    /// An address of this process.
    Address(usize),
    /// A byte of a mapped file, independent of the mapping.
    Mapped {
        device: String,
        inode: u64,
        offset: usize,
    },
}

fn address(sample: &TwinState) -> Place {
    Place::Address(std::ptr::from_ref(sample).addr())
}

/// The byte of the shared segment at which `sample` begins, from the kernel's list of mappings:
/// `start-end permissions offset device inode path`.
fn place_in_segment(sample: &TwinState) -> Place {
    let address = std::ptr::from_ref(sample).addr();
    let hex = |text: &str| usize::from_str_radix(text, 16).unwrap();
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    for line in maps.lines() {
        let fields: Vec<_> = line.split_whitespace().collect();
        let (start, end) = fields[0].split_once('-').unwrap();
        if (hex(start)..hex(end)).contains(&address) {
            assert!(fields[5].starts_with("/dev/shm/"), "{line}");
            return Place::Mapped {
                device: fields[3].to_owned(),
                inode: fields[4].parse().unwrap(),
                offset: address - hex(start) + hex(fields[2]),
            };
        }
    }
    panic!("{address:x} is not mapped");
}

/// Runs the twin over three samples, and returns the places where it wrote and where the reader read.
fn run(transport: &impl Transport, place_of: fn(&TwinState) -> Place) -> (Vec<Place>, Vec<Place>) {
    let before = InProcess::new();
    let one = Audience::of(Keep::All, 1);
    let input: Box<dyn Receiver<JointState>> = before.receiver("in", Keep::All, 8).unwrap();
    let mut states: Box<dyn Sender<JointState>> = before.sender("in", one).unwrap();
    for number in 1..=3_u8 {
        let fill = &mut |state: &mut JointState| {
            state.header.stamp_ns = number.into();
            state.effort[0] = number.into();
        };
        states.send_with(fill).unwrap();
    }
    states.end().unwrap();

    let mut output = transport.sender::<TwinState>("out", one).unwrap();
    let mut reader: Box<dyn Receiver<TwinState>> = transport.receiver("out", Keep::All, 8).unwrap();
    assert_eq!(output.wait_for_receivers(LONG).unwrap(), 0);
    let places = std::thread::scope(|scope| {
        let saw = scope.spawn(|| {
            let mut saw = Vec::new();
            let mut read = |twin: &TwinState| {
                assert!((twin.residual[0] - twin.header.stamp_ns as f64).abs() < 1e-9);
                saw.push(place_of(twin));
            };
            while (*reader).receive(LONG, &mut read).unwrap() == Received::Sample {}
            saw
        });
        let mut twin = Twin {
            place_of: Some(place_of),
            ..Twin::default()
        };
        let input = Input::Link {
            from: "in".to_owned(),
            open: Box::new(move || Ok(Box::new(input) as Box<dyn AnyReceiver>)),
        };
        let ends = Ends {
            output: Some(AnySender::new(output)),
            ..Ends::new("twin", vec![input])
        };
        let node = Node::stage(Box::new(&mut twin));
        shell::run(&Context::new("twin"), vec![(node, ends)]).unwrap();
        (twin.wrote, saw.join().unwrap())
    });
    assert_eq!((places.0.len(), places.1.len()), (3, 3));
    places
}

#[test]
fn in_process_the_reader_sees_the_address_that_was_written() {
    let (wrote, saw) = run(&InProcess::new(), address);
    assert_eq!(wrote, saw);
}

#[test]
#[cfg(target_os = "linux")]
fn over_shared_memory_the_reader_sees_the_byte_of_the_segment_that_was_written() {
    let domain = Domain::unique();
    {
        let links = SharedMemory::open(&domain).unwrap();
        let (wrote, saw) = run(&links, place_in_segment);
        assert_eq!(wrote, saw);
        // Each end has a mapping of its own, as in two processes: the same byte has another address.
        let (wrote, saw) = run(&links, address);
        assert!(wrote.iter().all(|place| !saw.contains(place)));
    }
    domain.remove().unwrap();
}
