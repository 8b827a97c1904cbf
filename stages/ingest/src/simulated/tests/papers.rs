//! The scenes of the papers, in `examples/scenarios`.

use std::collections::BTreeMap;

use super::*;

fn example(name: &str) -> Scenario {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/scenarios");
    scenario(&std::fs::read_to_string(format!("{folder}/{name}.yaml")).unwrap())
}

/// A recording's readings, its events and its cycle.
fn run(scenario: &Scenario, name: &str) -> (Vec<Reading>, Vec<Event>, Option<f64>) {
    let index = scenario
        .recordings
        .iter()
        .position(|each| each.name == name);
    let mut simulation = Simulation::new(scenario, &arm(), index.unwrap()).unwrap();
    let readings = std::iter::from_fn(|| simulation.next_reading().unwrap()).collect();
    (readings, simulation.events().to_vec(), simulation.cycle_s())
}

fn kinds(events: &[Event]) -> Vec<ContactKind> {
    events.iter().map(|event| event.kind).collect()
}

#[test]
fn the_assembly_has_collisions_and_cooperations_also_on_top_of_one_another() {
    use ContactKind::{Collision, Cooperation};
    let scenario = example("assembly");
    let (_, events, _) = run(&scenario, "assembly_free");
    assert_eq!(events, []);
    let (readings, mut events, _) = run(&scenario, "assembly_train");
    events.sort_by(|a, b| a.on_s.total_cmp(&b.on_s));
    assert!(kinds(&events).contains(&Collision), "{events:#?}");
    assert_eq!(
        kinds(&events)
            .iter()
            .filter(|kind| **kind == Cooperation)
            .count(),
        2
    );
    let hit = events.iter().find(|event| event.kind == Collision).unwrap();
    let led = events
        .iter()
        .find(|event| event.kind == Cooperation)
        .unwrap();
    assert!(
        hit.on_s < led.on_s && led.on_s < hit.off_s,
        "{hit:?} {led:?}"
    );
    assert!(
        (5.0..120.0).contains(&hit.peak_n()) && hit.force_n[2] > 0.0,
        "{hit:?}"
    );
    let flagged = readings.iter().filter(|reading| reading.contact).count();
    assert!((500..6500).contains(&flagged), "{flagged} ms");
    let (_, events, _) = run(&scenario, "assembly_test");
    assert!(
        events
            .iter()
            .any(|event| event.link == "tool" && event.kind == Collision)
    );
    assert!(
        events
            .iter()
            .any(|event| event.link == "link3" && event.kind == Collision)
    );
}

#[test]
fn the_cycles_repeat_and_the_obstacles_are_hit() {
    let scenario = example("cyclic");
    let (readings, events, cycle_s) = run(&scenario, "cyclic_learn");
    assert_eq!(events, []);
    let cycle_s = cycle_s.unwrap();
    let cycle = (cycle_s * 500.0).round() as usize;
    let mut difference = 0.0_f64;
    for pair in readings[..2 * cycle].iter().zip(&readings[cycle..]) {
        for j in 0..N {
            let [now, next] = [pair.0, pair.1].map(|reading| reading.command_position[j]);
            difference = difference.max((now - next).abs());
        }
    }
    // A cycle is not whole samples.
    assert!(difference < 2e-3, "{difference} rad");
    for (name, zone, axis) in [
        ("cyclic_left_right", "NR", 1),
        ("cyclic_top_bottom", "EOS", 2),
    ] {
        let (_, events, _) = run(&scenario, name);
        assert_eq!(
            kinds(&events),
            [ContactKind::Collision],
            "{name}: {events:#?}"
        );
        let event = &events[0];
        assert_eq!(event.label.zone.as_deref(), Some(zone));
        assert!((15.0..400.0).contains(&event.force_n[axis]), "{event:?}");
        assert_eq!(event.joints.len(), N);
    }
}

#[test]
fn hands_touch_the_arm_on_random_paths() {
    let scenario = example("paths");
    let (readings, events, cycle_s) = run(&scenario, "paths_train");
    assert_eq!((events.len(), cycle_s), (0, None));
    // The paper's 30 degrees a second, on average over the fastest joint of each instant.
    let speeds = readings.iter().map(|reading| {
        reading.velocity[..N]
            .iter()
            .fold(0.0_f64, |most, v| most.max(v.abs()))
    });
    let mean = speeds.sum::<f64>() / readings.len() as f64;
    assert!((0.3..0.7).contains(&mean), "{mean} rad/s");
    let (_, events, _) = run(&scenario, "paths_test");
    assert_eq!(events.len(), 5);
    for event in &events {
        assert!(["link3", "link4", "link5", "link6"].contains(&event.link.as_str()));
        assert!((8.0..30.0).contains(&event.peak_n()));
    }
}

#[test]
fn the_same_seed_makes_the_same_bytes_of_every_scene() {
    for name in ["assembly", "cyclic", "paths"] {
        let mut scenario = example(name);
        let last = scenario.recordings.len() - 1;
        scenario.recordings.drain(..last);
        let brief = &mut scenario.recordings[0];
        brief.duration_s = 3.0;
        brief.contacts.clear();
        if let Some(hands) = &mut brief.hands {
            (hands.count, hands.after_s) = (1, 0.5);
        }
        if let Some(points) = &mut brief.motion.points {
            points.cycles = None;
        }
        let made: Vec<_> = [0, 0, 1]
            .into_iter()
            .map(|more| {
                scenario.seed += more;
                let folder = tempfile::tempdir().unwrap();
                let made = simulate(
                    &scenario,
                    &arm(),
                    folder.path(),
                    &BTreeMap::new(),
                    &mut |_| true,
                );
                let made = made.unwrap().unwrap();
                let labels = std::fs::read(made.labels_path).unwrap();
                (std::fs::read(&made.recordings[0].path).unwrap(), labels)
            })
            .collect();
        assert!(made[0] == made[1], "{name}");
        assert!(made[0].0 != made[2].0, "{name}");
    }
}
