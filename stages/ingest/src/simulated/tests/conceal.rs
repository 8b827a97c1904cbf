//! Concealed effects depend on the seed, are visible in the effort, and are reported only in `concealed.json`.

use std::collections::{BTreeMap, BTreeSet};

use super::*;

pub(super) fn concealing(conceal: &str) -> Scenario {
    scenario(&format!(
        "{{version: 1, robot: demo_arm.urdf, seed: 3, rate_hz: 100, conceal: {{{conceal}}}, \
          sensors: {{effort_noise_of_limit: 0.002}}, recordings: [\
          {{name: a, duration_s: 3, motion: {{fourier: {{period_s: 3}}}}}}, \
          {{name: b, duration_s: 3, motion: {{points: {{}}}}}}, \
          {{name: c, duration_s: 3, motion: {{fourier: {{period_s: 3}}}}}}]}}"
    ))
}

fn concealed(conceal: &str) -> Result<Concealed, String> {
    let scenario = concealing(conceal);
    let added = super::super::conceal::add(&scenario, &arm());
    added
        .map(|(_, concealed)| concealed.unwrap())
        .map_err(|error| error.to_string())
}

#[test]
fn a_seed_draws_the_same_and_another_another() {
    let mut names = BTreeSet::new();
    for seed in 0..12 {
        let drawn = concealed(&format!("seed: {seed}")).unwrap();
        assert_eq!(drawn, concealed(&format!("seed: {seed}")).unwrap());
        assert_eq!(drawn.effects.len(), 1);
        let effect = &drawn.effects[0];
        assert!((4.9..34.0).contains(&effect.times_noise), "{effect:?}");
        names.insert(effect.term.effect.clone());
    }
    assert!(names.len() > 5, "{names:?}");
}

#[test]
fn every_effect_that_can_be_drawn_can_be_simulated() {
    for (seed, effect) in tauscope_dynamics::terms::EFFECTS.iter().enumerate() {
        if effect.concealed.is_none() {
            continue;
        }
        let drawn = format!("seed: {seed}, effects: [{}]", effect.name);
        let concealed = concealed(&drawn).unwrap();
        assert_eq!(concealed.effects[0].term.effect, effect.name);
        let mut simulation = Simulation::new(&concealing(&drawn), &arm(), 0).unwrap();
        let mut readings = 0;
        while let Some(reading) = simulation.next_reading().unwrap() {
            let error = (0..N).map(|j| (reading.position[j] - reading.command_position[j]).abs());
            let worst = error.fold(0.0, f64::max);
            assert!(worst < 0.15, "{concealed:?}: {worst} rad off");
            readings += 1;
        }
        assert_eq!(readings, 301);
    }
}

#[test]
fn several_are_different_ones_in_different_joints() {
    let drawn = concealed("seed: 5, count: 4").unwrap();
    let names: BTreeSet<_> = drawn.effects.iter().map(|each| &each.term.effect).collect();
    assert_eq!(names.len(), 4);
    let joints: Vec<_> = drawn
        .effects
        .iter()
        .filter_map(|e| e.term.joint.clone())
        .collect();
    let different: BTreeSet<_> = joints.iter().collect();
    assert_eq!(joints.len(), different.len());
    assert!(concealed("seed: 5, count: 0").unwrap().effects.is_empty());
    let masses = concealed("seed: 5, effects: [payload, link_mass, link_com], count: 2");
    assert!(
        masses
            .unwrap_err()
            .starts_with("conceal: only 1 of 2 effects are visible")
    );
}

#[test]
fn what_cannot_be_drawn_is_said() {
    let unknown = concealed("seed: 1, effects: [viscous]").unwrap_err();
    assert!(
        unknown.starts_with("conceal: there is no effect `viscous` to be drawn; there are: visc")
    );
    let few = concealed("seed: 1, effects: [payload], count: 2").unwrap_err();
    assert_eq!(
        few,
        "conceal: `count` is 2, but there are only 1 effects to draw from"
    );
    let twice = concealed("seed: 1, effects: [payload, payload]").unwrap_err();
    assert_eq!(twice, "conceal: `payload` is there twice");
}

#[test]
fn the_answer_is_beside_the_recordings_and_the_same_again() {
    let make = |seed: u64| {
        let folder = tempfile::tempdir().unwrap();
        let scenario = concealing(&format!("seed: {seed}"));
        let made = simulate(
            &scenario,
            &arm(),
            folder.path(),
            &BTreeMap::default(),
            &mut |_| true,
        );
        let made = made.unwrap().unwrap();
        let answer = std::fs::read_to_string(made.concealed_path.unwrap()).unwrap();
        let recording = std::fs::read(&made.recordings[0].path).unwrap();
        (answer, recording)
    };
    let first = make(1);
    assert!(first == make(1));
    let other = make(2);
    assert!(first.0 != other.0 && first.1 != other.1);
    assert!(first.0.contains("\"effect\": "), "{}", first.0);
}

#[test]
fn the_bundled_scenario_conceals_something() {
    let path = Path::new(DATA).join("concealed.scenario.yaml");
    let scenario = scenario(&std::fs::read_to_string(path).unwrap());
    let (open, concealed) = super::super::conceal::add(&scenario, &arm()).unwrap();
    assert_eq!(concealed.unwrap().effects.len(), 1);
    assert!(open.conceal.is_none() && open.physics.len() == 1);
    let sensed = Simulation::new(&scenario, &arm(), 5)
        .unwrap()
        .next_reading();
    assert!(sensed.unwrap().is_some());
}
