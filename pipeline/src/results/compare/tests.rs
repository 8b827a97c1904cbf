use super::*;

fn event(stage: &str, t_s: f64, link: &str) -> EventRow {
    let ns = |t: f64| (t * 1e9) as i64;
    EventRow {
        sha256: "r".to_owned(),
        stage: stage.to_owned(),
        detector: stage.to_owned(),
        kind: "contact".to_owned(),
        link: Some(link.to_owned()),
        joints: vec!["joint3".to_owned()],
        t_ns: ns(t_s),
        end_ns: ns(t_s + 0.5),
        contact_ns: ns(t_s - 0.05),
        peak_score: Some(9.0),
        force_n: None,
    }
}

fn results(events: Vec<EventRow>) -> Results {
    Results {
        recordings: vec![RecordingRow {
            recording: "rec".to_owned(),
            sha256: "r".to_owned(),
            cell: "c".to_owned(),
            t_ns: 0,
        }],
        events,
    }
}

fn changes(comparison: &Comparison) -> Vec<(Change, &str)> {
    let all = comparison.differences.iter();
    all.map(|d| (d.change, d.link())).collect()
}

#[test]
fn each_event_is_the_same_or_has_appeared_vanished_or_moved() {
    let a = results(vec![
        event("d", 1.0, "link1"),
        event("d", 3.0, "link2"),
        event("d", 5.0, "link3"),
        event("d", 7.0, "link4"),
    ]);
    let b = results(vec![
        event("d", 1.02, "link1"),
        event("d", 3.3, "link2"),
        event("d", 7.0, "link5"),
        event("d", 9.0, "link6"),
    ]);
    let found = compare(&a, &b, 0.1).unwrap();
    let expected = [
        (Change::Moved, "link2"),
        (Change::Vanished, "link3"),
        (Change::Moved, "link5"),
        (Change::Appeared, "link6"),
    ];
    assert_eq!(changes(&found), expected);
    assert_eq!((found.same, found.events_a, found.events_b), (1, 4, 4));
    let counts = Counts {
        appeared: 1,
        vanished: 1,
        moved: 2,
    };
    assert_eq!(found.cells["c"], counts);
    assert_eq!(found.joints["c"]["joint3"], counts);
    assert_eq!(found.links["c"]["link6"].appeared, 1);
    assert_eq!(found.differences[0].window_ns.1, 3_800_000_000);
    assert_eq!(compare(&a, &a, 0.0).unwrap().differences, []);
}

#[test]
fn another_detector_in_the_place_of_one_is_compared_with_it_and_not_with_the_rest() {
    let a = results(vec![event("kept", 1.0, "l"), event("old", 1.0, "l")]);
    let b = results(vec![event("new", 1.01, "l")]);
    // B has no stage `kept`, so the events of `kept` and `old` are pooled; one of them pairs.
    assert_eq!(changes(&compare(&a, &b, 0.1).unwrap()).len(), 1);
    let b = results(vec![event("kept", 9.0, "l"), event("new", 1.01, "l")]);
    let found = compare(&a, &b, 0.1).unwrap();
    let expected = [(Change::Vanished, "l"), (Change::Appeared, "l")];
    assert_eq!((changes(&found), found.same), (expected.to_vec(), 1));
}

#[test]
fn a_recording_that_one_result_has_not_is_named_and_one_that_it_has_twice_refused() {
    let a = results(vec![event("d", 1.0, "l")]);
    let found = compare(&a, &Results::default(), 0.1).unwrap();
    assert_eq!((found.recordings, found.only_in_a.len()), (0, 1));
    let mut twice = a.clone();
    twice.recordings.push(a.recordings[0].clone());
    assert_eq!(compare(&a, &twice, 0.1).unwrap_err().result, "B");
}
