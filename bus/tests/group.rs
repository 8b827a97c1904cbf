//! A stage group in one thread: routing of samples, and failures of a stage.

// Helpers outside a test function.
#![allow(clippy::unwrap_used)]

use std::sync::{Arc, Mutex};

use tauscope_bus::seat::AnySender;
use tauscope_bus::shell::{self, Context, Ends, Input, Node, Outcome, Report};
use tauscope_bus::{
    Audience, Detection, Emit, InProcess, JointState, Keep, Progress, Received, Receiver, Source,
    Stage, StageError, Transport, TwinState,
};

/// Emits stamps 0, 1, ... two at a time.
struct Counter(i64);

impl Source<JointState> for Counter {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        if self.0 == 100 {
            return Ok(Progress::End);
        }
        for _ in 0..2 {
            out.emit(&mut |state| state.header.stamp_ns = self.0)?;
            self.0 += 1;
        }
        Ok(Progress::More)
    }
}

/// Emits every sample, and one more at the end.
struct Twin;

impl Stage<JointState, TwinState> for Twin {
    fn accept(
        &mut self,
        state: &JointState,
        out: &mut dyn Emit<TwinState>,
    ) -> Result<(), StageError> {
        assert_eq!(state.header.stamp_ns, state.header.sequence as i64);
        Ok(out.emit(&mut |twin| twin.header.stamp_ns = state.header.stamp_ns)?)
    }

    fn finish(&mut self, out: &mut dyn Emit<TwinState>) -> Result<(), StageError> {
        Ok(out.emit(&mut |twin| twin.header.stamp_ns = 1_000)?)
    }
}

type Heard = Arc<Mutex<Vec<(&'static str, i64)>>>;

/// Behaviour of a detector at the stamp 50.
#[derive(Clone, Copy, PartialEq)]
enum Mood {
    Well,
    Fails,
    Panics,
    Unfit,
}

struct Detector(&'static str, Heard, Mood);

impl Stage<TwinState, Detection> for Detector {
    fn accept(
        &mut self,
        twin: &TwinState,
        out: &mut dyn Emit<Detection>,
    ) -> Result<(), StageError> {
        let stamp_ns = twin.header.stamp_ns;
        self.1.lock().unwrap().push((self.0, stamp_ns));
        match self.2 {
            Mood::Fails if stamp_ns == 50 => return Err(StageError::failed("it is broken")),
            Mood::Unfit if stamp_ns == 50 => return Err(StageError::Unfit("no".to_owned())),
            Mood::Panics if stamp_ns == 50 => panic!("it is upset"),
            _ => {}
        }
        Ok(out.emit(&mut |detection| detection.header.stamp_ns = stamp_ns)?)
    }
}

/// The stage of that name behind another.
fn behind(stage: &str, from: &str) -> Ends {
    Ends::new(stage, vec![Input::Of(from.to_owned())])
}

/// A source, a twin whose stream also has a receiver outside the group, and two detectors, the second in this mood.
fn run(mood: Mood) -> (Vec<Report>, Vec<(&'static str, i64)>, Vec<i64>) {
    let links = InProcess::new();
    let mut outside: Box<dyn Receiver<TwinState>> =
        links.receiver("c/twin", Keep::All, 1_024).unwrap();
    let link = links.sender::<TwinState>("c/twin", Audience::of(Keep::All, 1));
    let heard = Heard::default();
    let detector = |name, mood| Node::stage(Box::new(Detector(name, Arc::clone(&heard), mood)));
    let twin = Ends {
        output: Some(AnySender::new(link.unwrap())),
        ..behind("twin", "count")
    };
    let nodes = vec![
        (
            Node::source(Box::new(Counter(0))),
            Ends::new("count", vec![]),
        ),
        (Node::stage(Box::new(Twin)), twin),
        (detector("one", Mood::Well), behind("one", "twin")),
        (detector("two", mood), behind("two", "twin")),
    ];
    let soon = std::time::Duration::from_millis(500);
    let (reports, seen) = std::thread::scope(|scope| {
        let seen = scope.spawn(move || {
            let mut seen = Vec::new();
            let read = &mut |twin: &TwinState| seen.push(twin.header.stamp_ns);
            while outside.receive(soon, read).unwrap() == Received::Sample {}
            seen
        });
        let reports = shell::run(&Context::new("count"), nodes).unwrap();
        (reports, seen.join().unwrap())
    });
    let heard = heard.lock().unwrap().clone();
    (reports, heard, seen)
}

#[test]
fn a_stage_that_hangs_is_named_though_others_share_its_thread() {
    let (go_on, until_it_may) = std::sync::mpsc::channel();
    let stuck = Node::stage(Box::new(Stuck(until_it_may)));
    let well = Detector("well", Heard::default(), Mood::Well);
    let nodes = vec![
        (
            Node::source(Box::new(Counter(0))),
            Ends::new("count", vec![]),
        ),
        (Node::stage(Box::new(Twin)), behind("twin", "count")),
        (Node::stage(Box::new(well)), behind("well", "twin")),
        (stuck, behind("stuck", "twin")),
    ];
    let context = Context::new("count");
    let board = context.board.clone();
    let soon = std::time::Duration::from_mins(1);
    std::thread::scope(|scope| {
        let begin = std::time::Instant::now();
        scope.spawn(move || {
            while board.stuck(std::time::Instant::now()).is_none() && begin.elapsed() < soon {
                std::thread::sleep(std::time::Duration::from_millis(10));
            }
            let found = board.stuck(std::time::Instant::now());
            go_on.send(()).unwrap();
            assert_eq!(found.map(|(stage, _)| stage).as_deref(), Some("stuck"));
        });
        let reports = shell::run(&context, nodes).unwrap();
        assert!(reports.iter().all(Report::is_complete), "{reports:?}");
    });
    // A group that has ended is not hung.
    let later = std::time::Instant::now() + soon;
    assert_eq!(context.board.stuck(later), None);
}

/// Blocks at the stamp 10 until it is released.
struct Stuck(std::sync::mpsc::Receiver<()>);

impl Stage<TwinState, Detection> for Stuck {
    fn accept(
        &mut self,
        twin: &TwinState,
        out: &mut dyn Emit<Detection>,
    ) -> Result<(), StageError> {
        if twin.header.stamp_ns == 10 {
            self.0.recv().unwrap();
        }
        Ok(out.emit(&mut |detection| detection.header.stamp_ns = twin.header.stamp_ns)?)
    }
}

fn counts(reports: &[Report]) -> Vec<(&str, u64, u64)> {
    let one = reports.iter();
    one.map(|report| (report.stage.as_str(), report.received, report.emitted))
        .collect()
}

#[test]
fn each_sample_goes_through_all_stages_before_the_next_and_to_those_outside() {
    let (reports, heard, seen) = run(Mood::Well);
    assert_eq!(
        counts(&reports),
        [
            ("count", 100, 100),
            ("twin", 100, 101),
            ("one", 101, 101),
            ("two", 101, 101)
        ]
    );
    let stamps = || (0..100).chain([1_000]);
    assert!(seen.into_iter().eq(stamps()));
    assert!(
        heard
            .into_iter()
            .eq(stamps().flat_map(|stamp| [("one", stamp), ("two", stamp)]))
    );
    for report in &reports {
        assert_eq!(report.outcome, Some(Outcome::Ended), "{report:?}");
        assert!(report.is_complete(), "{report:?}");
        assert!(report.inputs.iter().all(|input| input.ended), "{report:?}");
    }
}

#[test]
fn where_a_stage_fails_or_panics_the_tree_ends_says_who_it_was_and_the_books_balance() {
    for (mood, outcome) in [
        (Mood::Fails, Outcome::Failed("it is broken".to_owned())),
        (Mood::Unfit, Outcome::Unfit("no".to_owned())),
        (
            Mood::Panics,
            Outcome::Failed("it panicked: it is upset".to_owned()),
        ),
    ] {
        let (reports, _, seen) = run(mood);
        for report in &reports {
            let with = Outcome::Failed("stage `two`, which runs with it, failed".to_owned());
            let expected = if report.stage == "two" {
                &outcome
            } else {
                &with
            };
            assert_eq!(report.outcome.as_ref(), Some(expected));
        }
        assert_eq!(
            counts(&reports),
            [
                ("count", 51, 51),
                ("twin", 51, 51),
                ("one", 51, 51),
                ("two", 51, 50)
            ]
        );
        let outside = if mood == Mood::Panics { 50 } else { 51 };
        assert_eq!(seen.len(), outside);
    }
}
