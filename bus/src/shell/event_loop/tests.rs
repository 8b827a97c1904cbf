use std::collections::VecDeque;
use std::sync::{Mutex, mpsc};

use super::*;
use crate::sample::JointState;
use crate::shell::group::{Ends, Node};
use crate::stage::{Emit, Progress, Source, StageError};

/// Emits a sample a millisecond, and panics or fails at the tenth if told so.
struct Paced {
    due: Instant,
    sent: u64,
    length: u64,
    end: End,
    /// Times of the samples.
    times: mpsc::Sender<Instant>,
}

#[derive(Clone, Copy, PartialEq)]
enum End {
    Ends,
    Panics,
    Fails,
}

impl Source<JointState> for Paced {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        if self.sent == self.length {
            return Ok(Progress::End);
        }
        assert!(self.sent != 10 || self.end != End::Panics, "on purpose");
        if self.sent == 10 && self.end == End::Fails {
            return Err(StageError::failed("on purpose"));
        }
        let now = Instant::now();
        if now < self.due {
            return Ok(Progress::Until(self.due));
        }
        self.due += Duration::from_millis(1);
        self.sent += 1;
        let _ = self.times.send(now);
        out.emit(&mut |sample| sample.header.stamp_ns = 0)?;
        Ok(Progress::More)
    }
}

/// Runs one source for each `end` in one loop, and returns their last reports and the times of their samples.
fn run_all(ends: &[End], length: u64) -> (Vec<Report>, Vec<Vec<Instant>>) {
    let reports = Arc::new(Mutex::new(Vec::new()));
    let (mut tasks, mut times) = (VecDeque::new(), Vec::new());
    for (index, &end) in ends.iter().enumerate() {
        let (sender, receiver) = mpsc::channel();
        times.push(receiver);
        let name = format!("source{index}");
        let source = Paced {
            // Not in step with the others.
            due: Instant::now() + Duration::from_micros(37 * index as u64),
            sent: 0,
            length,
            end,
            times: sender,
        };
        let (context, reports) = (Context::new(&name), Arc::clone(&reports));
        tasks.push_back(Task {
            nodes: vec![(Node::source(Box::new(source)), Ends::new(&name, vec![]))],
            context,
            within: Duration::ZERO,
            ready: |_, _| {},
            done: Box::new(move |last| reports.lock().unwrap().extend(last)),
        });
    }
    EventLoop::new()
        .unwrap()
        .run(&mut || Poll::Ready(tasks.pop_front()));
    let mut reports = std::mem::take(&mut *reports.lock().unwrap());
    reports.sort_by(|a, b| a.stage.cmp(&b.stage));
    let times = times.iter().map(|times| times.try_iter().collect());
    (reports, times.collect())
}

#[test]
fn a_group_that_fails_or_panics_leaves_the_others_of_its_loop_alone() {
    let (reports, _) = run_all(&[End::Ends, End::Panics, End::Fails, End::Ends], 50);
    let outcomes: Vec<_> = reports
        .iter()
        .map(|report| report.outcome.clone())
        .collect();
    assert_eq!(
        outcomes,
        [
            Some(Outcome::Ended),
            Some(Outcome::Failed("it panicked: on purpose".to_owned())),
            Some(Outcome::Failed("on purpose".to_owned())),
            Some(Outcome::Ended),
        ]
    );
    let emitted: Vec<_> = reports.iter().map(|report| report.emitted).collect();
    assert_eq!(emitted, [50, 10, 10, 50]);
}

#[test]
fn sources_that_are_out_of_step_share_wake_ups() {
    let (reports, times) = run_all(&[End::Ends; 20], 100);
    assert!(reports.iter().all(|report| report.emitted == 100));
    let mut all: Vec<Instant> = times.into_iter().flatten().collect();
    all.sort_unstable();
    // Samples of one wake-up follow each other without a pause.
    let pauses = all.windows(2).filter(|pair| pair[1] - pair[0] > SLACK / 4);
    let wake_ups = pauses.count() + 1;
    assert!(wake_ups <= 400, "{wake_ups} wake-ups for 2000 samples");
}
