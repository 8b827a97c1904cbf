//! Tests of the wall.

use tauscope_publish::message::{AlarmState, StatusMessage};

use super::*;
use crate::fixture;

struct Story {
    wall: Wall,
    now: Now,
    effects: Vec<Effect>,
}

impl Story {
    fn new(expected: &[&str]) -> Self {
        let mut story = Self {
            wall: Wall::new(expected.iter().map(|name| (*name).to_owned())),
            now: Now {
                running_ms: 0,
                unix_ns: 1_000_000_000_000,
            },
            effects: Vec::new(),
        };
        story.tell(Event::Reached(1));
        story
    }

    fn tell(&mut self, event: Event) -> &mut Self {
        let effects = self.wall.take(event, self.now);
        self.effects.extend(effects);
        self
    }

    fn wait(&mut self, ms: u64) -> &mut Self {
        self.now.running_ms += ms;
        self.now.unix_ns += ms as i64 * 1_000_000;
        let effects = self.wall.tick(self.now);
        self.effects.extend(effects);
        self
    }

    fn alive(&mut self, instance: &str) -> &mut Self {
        let (cell, instance) = ("a".to_owned(), instance.to_owned());
        self.tell(Event::Alive { cell, instance })
    }

    fn gone(&mut self, instance: &str) -> &mut Self {
        let (cell, instance) = ("a".to_owned(), instance.to_owned());
        self.tell(Event::Gone { cell, instance });
        // Until then its last status may come.
        self.wait(PARTING_MS)
    }

    fn status(&mut self, change: impl FnOnce(&mut StatusMessage)) -> &mut Self {
        let mut status = fixture::status("x", 0);
        status.sent_ns = self.now.unix_ns;
        change(&mut status);
        let (cell, status) = ("a".to_owned(), Box::new(status));
        self.tell(Event::Status { cell, status })
    }

    fn is(&mut self, words: &str) -> &mut Self {
        let state = self.wall.state("a").unwrap();
        assert_eq!(state.words(), words, "{state:?}");
        self
    }

    fn because(&mut self, part: &str) -> &mut Self {
        let reason = self.wall.state("a").unwrap().reason();
        assert!(reason.contains(part), "{reason}");
        self
    }
}

#[test]
fn a_cell_is_running_only_with_token_status_samples_and_a_detector_that_judges() {
    let mut story = Story::new(&["a"]);
    story.is("never seen");
    story.alive("x").is("unknown");
    story.status(|_| {}).is("running");
    story
        .status(|status| status.alarm.state = AlarmState::NotReady)
        .is("not ready");
    story.wait(1).status(|status| {
        status.alarm.state = AlarmState::Silent;
        status.last_sample_age_ms = Some(5000);
    });
    story.is("stale").because("no samples");
    story.wait(1).status(|status| {
        status.alarm.state = AlarmState::Silent;
        status.alarm.stamp_ns = 0;
    });
    story.is("not ready");
    story.wait(1).status(|_| {}).is("running");
}

#[test]
fn an_answer_that_comes_late_replaces_nothing_that_the_cell_has_said_since() {
    let mut story = Story::new(&[]);
    let answer = |state: AlarmState| {
        let mut status = fixture::status("x", 0);
        status.alarm.state = state;
        Event::Answer {
            cell: "a".to_owned(),
            status: Box::new(status),
        }
    };
    story.alive("x").tell(answer(AlarmState::NotReady));
    story.is("not ready").wait(1);
    story.status(|_| {}).is("running");
    story.tell(answer(AlarmState::NotReady)).is("running");
}

#[test]
fn a_cell_whose_clock_is_set_back_is_heard_on() {
    let mut story = Story::new(&[]);
    story.alive("x").status(|_| {}).is("running");
    for _ in 0..10 {
        story.wait(1_000).status(|status| {
            status.sent_ns -= 3_600_000_000_000;
            status.alarm.state = AlarmState::Collision;
        });
        story.is("stopped by latch");
    }
}

#[test]
fn a_status_without_a_token_is_not_green() {
    let mut story = Story::new(&[]);
    story.status(|_| {}).is("unknown").because("token");
    story.alive("x").is("running");
}

#[test]
fn a_cell_that_ran_before_this_host_began_runs_for_nobody_knows_how_long() {
    let shown = |story: &Story| story.wall.snapshot().cells.remove(0);
    let mut story = Story::new(&[]);
    story.alive("x").status(|_| {}).is("running");
    assert_eq!(shown(&story).since_ns, None);
    story
        .wait(1)
        .status(|status| status.alarm.state = AlarmState::NotReady);
    story.is("not ready");
    assert_eq!(shown(&story).since_ns, Some(story.now.unix_ns));
    story.wait(1).status(|_| {}).is("running");
    assert_eq!(shown(&story).since_ns, Some(story.now.unix_ns));
}

#[test]
fn a_token_that_goes_is_known_at_once_and_a_cut_cell_within_five_seconds() {
    let mut story = Story::new(&[]);
    story.alive("x").status(|_| {}).is("running");
    story.gone("x").is("stale").because("process is gone");
    story.alive("x").wait(1).status(|_| {}).is("running");
    story.wait(3000).is("running");
    story.wait(1500).is("stale").because("no status");
    let changed = |effect: &&Effect| matches!(effect, Effect::Changed { .. });
    assert_eq!(story.effects.iter().filter(changed).count(), 4);
}

#[test]
fn a_cell_that_was_silent_is_stale_since_then_also_when_its_token_goes() {
    let mut story = Story::new(&[]);
    story.alive("x").status(|_| {});
    let silent_since = story.now.unix_ns;
    story.wait(10_000).gone("x").is("stale").because("cut off");
    let State::Stale { since_ns, .. } = story.wall.state("a").unwrap() else {
        panic!();
    };
    assert_eq!(since_ns, silent_since);
}

#[test]
fn a_clock_that_is_off_for_certain_is_told_of() {
    let mut story = Story::new(&[]);
    story.alive("x").status(|_| {});
    let asked = |story: &Story| {
        let is_clock = |effect: &&Effect| matches!(effect, Effect::AskClock { .. });
        story.effects.iter().filter(is_clock).count()
    };
    assert_eq!(asked(&story), 1);
    let answer = |story: &mut Story, instance: &str, ahead_ms: i64, most_ms: i64| {
        let offset = Offset {
            ahead_ns: ahead_ms * 1_000_000,
            uncertainty_ns: most_ms * 1_000_000,
        };
        let (cell, instance) = ("a".to_owned(), instance.to_owned());
        story.tell(Event::Clock {
            cell,
            instance,
            offset,
        });
        let view = story.wall.snapshot().cells.remove(0);
        (view.clock_ahead_ms, view.clock_is_off)
    };
    // A slow network leaves it open.
    assert_eq!(answer(&mut story, "x", 340, 300), (Some(340.0), false));
    assert_eq!(answer(&mut story, "x", 339, 2), (Some(339.0), true));
    // A measurement of another publisher instance is ignored.
    assert_eq!(answer(&mut story, "y", 0, 1), (Some(339.0), true));
    assert_eq!(answer(&mut story, "x", 1, 1), (Some(1.0), false));
    // It is asked again, in the beginning more often.
    for _ in 0..30 {
        story.wait(1_000).status(|_| {});
        answer(&mut story, "x", 1, 1);
    }
    assert!((4..8).contains(&asked(&story)), "{}", asked(&story));
}

#[test]
fn a_fleet_host_that_reaches_nobody_says_so_of_itself() {
    let mut story = Story::new(&[]);
    story.alive("x").status(|_| {});
    story.tell(Event::Reached(0)).gone("x");
    story.is("stale").because("this fleet host");
    assert_eq!(story.wall.snapshot().sessions_reached, 0);
}

#[test]
fn a_latched_alarm_stands_first_and_a_mute_ends_by_itself() {
    let mut story = Story::new(&[]);
    story.alive("x");
    story.status(|status| status.alarm.state = AlarmState::Collision);
    story.is("stopped by latch").wait(1);
    story.status(|status| status.alarm.state = AlarmState::Acknowledged);
    story.is("stopped, acknowledged").wait(1);
    story
        .status(|status| status.alarm.muted_s = 2.0)
        .is("muted");
    let State::Muted { until_ns } = story.wall.state("a").unwrap() else {
        panic!();
    };
    assert_eq!(until_ns, story.now.unix_ns + 2_000_000_000);
    story.wait(2001).is("running");
    story.status(|status| {
        status.alarm.state = AlarmState::Contact;
        status.alarm.muted_s = 2.0;
    });
    story.is("muted").wait(2001).is("contact");
}

#[test]
fn a_latch_is_as_old_as_it_is_whatever_the_fleet_host_has_missed() {
    let mut story = Story::new(&[]);
    let latched = |ms: u64| {
        move |status: &mut StatusMessage| {
            status.alarm.state = AlarmState::Collision;
            status.alarm.latched_for_ms = Some(ms);
        }
    };
    let shown = |story: &Story| story.wall.snapshot().cells.remove(0);
    // A fleet host that was started an hour after the latch.
    let since_ns = story.now.unix_ns - 3_600_000 * 1_000_000;
    story.alive("x").status(latched(3_600_000));
    assert_eq!(shown(&story).since_ns, Some(since_ns));
    // Silence, and a cut: the cell is stale, and latched nevertheless.
    story.wait(5_000).is("stale");
    assert_eq!(shown(&story).latched_since_ns, Some(since_ns));
    assert_eq!(shown(&story).severity, Severity::Critical);
    story.status(|status| {
        latched(3_605_000)(status);
        status.alarm.state = AlarmState::Silent;
    });
    story.is("stale").wait(1_000);
    story.status(latched(3_606_000)).is("stopped by latch");
    assert_eq!(shown(&story).since_ns, Some(since_ns));
    // The publisher is started again, and does not know since when.
    story.wait(1_000).gone("x").alive("y").status(|status| {
        status.instance = "y".to_owned();
        latched(10)(status);
    });
    assert_eq!(shown(&story).since_ns, Some(since_ns));
    // It is released, and latched again.
    story.wait(1_000);
    story.status(|status| status.instance = "y".to_owned());
    assert_eq!(shown(&story).latched_since_ns, None);
    assert_eq!(shown(&story).severity, Severity::Good);
    story.wait(1_000).status(|status| {
        status.instance = "y".to_owned();
        latched(100)(status);
    });
    let anew_ns = story.now.unix_ns - 100_000_000;
    assert_eq!(shown(&story).since_ns, Some(anew_ns));
}

#[test]
fn a_run_that_ended_in_order_is_no_failure() {
    let mut story = Story::new(&[]);
    story
        .alive("x")
        .status(|status| status.ended = true)
        .gone("x");
    story.wait(60_000).is("ended");
    // Another run begins.
    story.alive("y").wait(1);
    story
        .status(|status| status.instance = "y".to_owned())
        .is("running");
}

#[test]
fn two_publishers_of_one_name_are_a_fault_and_a_stranger_does_not_replace_the_status() {
    let mut story = Story::new(&[]);
    story.alive("x").status(|_| {}).wait(1);
    story.status(|status| {
        status.instance = "stranger".to_owned();
        status.alarm.state = AlarmState::Collision;
    });
    story.is("running");
    story
        .alive("stranger")
        .is("unknown")
        .because("two publishers");
    story.gone("stranger").is("running");
}

#[test]
fn samples_that_are_lost_are_counted_over_restarts() {
    let mut story = Story::new(&[]);
    let lost = |dropped: u64| move |status: &mut StatusMessage| status.stages[0].dropped = dropped;
    story.alive("x").status(lost(3)).wait(1);
    story.status(lost(3)).wait(1);
    story.status(lost(10));
    let samples = story.effects.iter().filter_map(|effect| match effect {
        Effect::Lost { samples, .. } => Some(*samples),
        _ => None,
    });
    // The first status of a publisher instance contains the losses before this host listened.
    assert_eq!(samples.collect::<Vec<_>>(), [7]);
    assert_eq!(story.wall.snapshot().cells[0].lost_samples, 10);
}

#[test]
fn two_publishers_of_one_name_tell_their_losses_and_records_once() {
    let mut story = Story::new(&[]);
    story.alive("x").alive("y");
    let number_of_asked = |story: &Story| {
        let asks = |effect: &&Effect| {
            matches!(
                effect,
                Effect::AskRecords { .. } | Effect::Lost { .. } | Effect::AskClock { .. }
            )
        };
        story.effects.iter().filter(asks).count()
    };
    for _ in 0..5 {
        for life in ["x", "y"] {
            story.status(|status| {
                status.instance = life.to_owned();
                status.stages[0].dropped = 5;
                status.last_record = 7;
            });
            for number in 1..=7 {
                let record = fixture::record(life, number, fixture::contact(number, 5));
                story.tell(Event::Record {
                    cell: "a".to_owned(),
                    record: Box::new(record),
                });
            }
        }
    }
    // Each is asked for its records and its clock.
    assert_eq!(number_of_asked(&story), 4, "{:?}", story.effects);
    assert_eq!(story.wall.snapshot().cells[0].lost_samples, 5);
}

#[test]
fn records_that_were_missed_are_asked_for() {
    let mut story = Story::new(&[]);
    story
        .alive("x")
        .status(|status| status.last_record = 0)
        .wait(1);
    let record = |number| Event::Record {
        cell: "a".to_owned(),
        record: Box::new(fixture::record("x", number, fixture::contact(number, 5))),
    };
    story.tell(record(1)).tell(record(4));
    let recorded = |effect: &&Effect| matches!(effect, Effect::Recorded { .. });
    assert_eq!(story.effects.iter().filter(recorded).count(), 2);
    story.status(|status| status.last_record = 4);
    let asked = Effect::AskRecords {
        cell: "a".to_owned(),
        after: 1,
    };
    assert!(story.effects.contains(&asked), "{:?}", story.effects);
    story
        .tell(record(2))
        .tell(record(3))
        .tell(record(4))
        .wait(1);
    story.effects.clear();
    story.status(|status| status.last_record = 4);
    assert_eq!(story.effects, []);
}

fn remembered(seen_ns: i64, ended_ns: Option<i64>) -> Remembered {
    Remembered {
        cell: "a".to_owned(),
        seen_ns,
        ended_ns,
    }
}

#[test]
fn a_cell_that_was_lost_while_this_host_was_down_is_told_of_once() {
    let missing = |story: &Story| {
        let is_missing = |effect: &&Effect| matches!(effect, Effect::Missing { .. });
        story.effects.iter().filter(is_missing).count()
    };
    let mut story = Story::new(&[]);
    story.wall.remember(remembered(5, None), None);
    story.wait(1).wait(BACK_AFTER_MS - 2);
    assert_eq!(missing(&story), 0);
    story.wait(1).wait(60_000).is("stale");
    assert_eq!(missing(&story), 1);
    // A cell that has come back, and one whose run has ended normally.
    let mut story = Story::new(&[]);
    story.wall.remember(remembered(5, None), None);
    story.wait(1).alive("x").status(|_| {}).wait(BACK_AFTER_MS);
    assert_eq!(missing(&story), 0);
    let mut story = Story::new(&[]);
    story.wall.remember(remembered(5, Some(6)), None);
    story.wait(1).wait(BACK_AFTER_MS).is("ended");
    assert_eq!(missing(&story), 0);
}

#[test]
fn a_cell_that_was_there_in_an_earlier_life_is_stale_since_then() {
    let mut story = Story::new(&[]);
    story.wall.remember(remembered(5, None), None);
    story.is("stale");
    assert_eq!(story.wall.snapshot().cells[0].since_ns, Some(5));
    // One of an older version does not tell how old its latch is.
    let latched = Some(("x".to_owned(), 3));
    story.wall.remember(remembered(5, None), latched);
    assert_eq!(story.wall.snapshot().cells[0].latched_since_ns, Some(3));
    story.alive("x");
    story.status(|status| status.alarm.state = AlarmState::Collision);
    assert_eq!(story.wall.snapshot().cells[0].since_ns, Some(3));
}

#[test]
fn the_worst_stands_first_and_then_the_longest() {
    let mut story = Story::new(&["n"]);
    for (cell, state) in [
        ("good", AlarmState::Free),
        ("late", AlarmState::Collision),
        ("touched", AlarmState::Contact),
    ] {
        let (cell, instance) = (cell.to_owned(), cell.to_owned());
        let mut status = fixture::status(&instance, 0);
        status.alarm.state = state;
        story.tell(Event::Alive {
            cell: cell.clone(),
            instance,
        });
        let status = Box::new(status);
        story.tell(Event::Status { cell, status });
    }
    let snapshot = story.wall.snapshot();
    let order: Vec<&str> = snapshot
        .cells
        .iter()
        .map(|cell| cell.cell.as_str())
        .collect();
    assert_eq!(order, ["late", "n", "touched", "good"]);
    assert_eq!(
        (snapshot.totals["running"], snapshot.totals["stale"]),
        (1, 0)
    );
}

#[test]
fn a_residual_is_compared_with_the_calibration_and_the_joint_that_grew_most_is_named() {
    let mut story = Story::new(&[]);
    story.alive("x").status(|_| {});
    let snapshot = story.wall.snapshot();
    let residual = snapshot.cells[0].residual.as_ref().unwrap();
    assert_eq!(
        (residual.joint.as_str(), residual.joint_ratio),
        ("joint2", 3.0)
    );
    assert!((residual.ratio - 5f64.sqrt()).abs() < 1e-12);
}

#[test]
fn memory_is_bounded_whoever_speaks() {
    let mut story = Story::new(&[]);
    for n in 0..MAX_CELLS + 5 {
        let (cell, instance) = (format!("c{n}"), "x".to_owned());
        story.tell(Event::Alive { cell, instance });
    }
    for n in 0..20 {
        let (cell, instance) = ("c0".to_owned(), format!("y{n}"));
        story.tell(Event::Alive { cell, instance });
    }
    let snapshot = story.wall.snapshot();
    assert_eq!(snapshot.cells.len(), MAX_CELLS);
    assert_eq!(snapshot.refused["too many cells"], 5);
    assert_eq!(snapshot.refused["too many lives of one cell"], 13);
}

#[test]
fn a_thousand_cells_pass_in_a_fraction_of_their_second() {
    let mut story = Story::new(&[]);
    let begin = std::time::Instant::now();
    for round in 1..=10 {
        for n in 0..1000 {
            let (cell, instance) = (format!("c{n}"), "x".to_owned());
            if round == 1 {
                story.tell(Event::Alive {
                    cell: cell.clone(),
                    instance,
                });
            }
            let status = Box::new(fixture::status("x", round));
            story.tell(Event::Status { cell, status });
        }
        story.wait(1000);
        assert_eq!(story.wall.snapshot().totals["running"], 1000);
    }
    // Ten seconds of a thousand cells. Measured: 0.2 s.
    assert!(begin.elapsed().as_secs() < 10, "{:?}", begin.elapsed());
}

#[test]
fn equals_stand_in_the_order_in_which_people_count() {
    let names = [
        "press-10", "weld", "press-2", "press-02", "press", "press-2b",
    ];
    let wall = Wall::new(names.map(str::to_owned));
    let cells = wall.snapshot().cells;
    let shown: Vec<&str> = cells.iter().map(|view| view.cell.as_str()).collect();
    assert_eq!(
        shown,
        [
            "press", "press-2", "press-2b", "press-02", "press-10", "weld"
        ]
    );
}

#[test]
fn a_cell_with_another_urdf_than_the_others_of_its_robot_is_marked() {
    let mut story = Story::new(&[]);
    for (cell, urdf) in [("a", "11"), ("b", "11"), ("c", "22")] {
        let mut status = fixture::status("x", 0);
        status.urdf_sha256 = Some(urdf.repeat(32));
        story.tell(Event::Status {
            cell: cell.to_owned(),
            status: Box::new(status),
        });
    }
    let snapshot = story.wall.snapshot();
    let marked = snapshot.cells.iter().filter(|cell| cell.urdf_differs);
    assert!(marked.map(|cell| cell.cell.as_str()).eq(["c"]));
}

#[test]
fn a_mute_of_a_latched_cell_is_told_until_it_ends() {
    let mut story = Story::new(&["a"]);
    story.alive("x").status(|status| {
        status.alarm.state = AlarmState::Collision;
        status.alarm.muted_s = 30.0;
    });
    let until = |story: &Story| {
        let snapshot = story.wall.snapshot();
        snapshot.cells[0].muted_behind(snapshot.now_ns)
    };
    let first = until(&story);
    assert!(first.is_some());
    story.wait(2_000).is("stopped by latch");
    assert_eq!(until(&story), first);
    story.wait(29_000);
    assert_eq!(until(&story), None);
}

#[test]
fn a_run_that_ends_in_order_is_never_silent_in_whatever_order_its_end_is_heard() {
    let mut story = Story::new(&["a"]);
    story.alive("x").status(|_| {}).is("running");
    let (cell, instance) = ("a".to_owned(), "x".to_owned());
    story.tell(Event::Gone { cell, instance }).is("running");
    story
        .wait(1)
        .status(|status| status.ended = true)
        .is("ended");
    story.wait(10_000).is("ended");
}
