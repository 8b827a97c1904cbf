//! The files that the documentation shows are good ones.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use crate::common::{Out, bundled, root, tauscope, write};

/// The first block of `document` that begins with this line.
fn block(document: &str, fence: &str) -> String {
    let text = std::fs::read_to_string(root().join("docs").join(document)).unwrap();
    let start = text.find(&format!("```{fence}\n")).unwrap() + fence.len() + 4;
    let rest = &text[start..];
    rest[..rest.find("```").unwrap()].to_owned()
}

fn passes(kind: &str, text: &str) {
    let folder = tempfile::tempdir().unwrap();
    let file = write(&folder.path().join("file.yaml"), text);
    let out = Out::answer(["check", "--kind", kind, file.to_str().unwrap()]);
    assert_eq!(out.code, 0, "{kind}: {}", out.stderr);
}

#[test]
fn the_twin_the_case_and_the_set_pass_the_check() {
    passes("twin", &block("twin.md", "yaml"));
    passes("case", &block("case-and-set.md", "yaml case"));
    passes("set", &block("case-and-set.md", "yaml set"));
}

#[test]
fn the_check_of_a_kind_refuses_another_kind() {
    let folder = tempfile::tempdir().unwrap();
    let file = write(
        &folder.path().join("set.yaml"),
        &block("case-and-set.md", "yaml set"),
    );
    let out = Out::answer(["check", "--kind", "case", file.to_str().unwrap()]);
    assert_eq!(out.code, 2);
    assert!(out.stderr.contains("unknown key `set`"), "{}", out.stderr);
}

#[test]
fn the_scenario_is_simulated_and_its_twin_calibrated_as_documented() {
    let folder = tempfile::tempdir().unwrap();
    let robot = folder.path().join("demo_arm.urdf");
    std::fs::copy(bundled().join("demo_arm.urdf"), &robot).unwrap();
    let file = write(
        &folder.path().join("scenario.yaml"),
        &block("scenario.md", "yaml"),
    );
    let mut simulate = tauscope();
    simulate
        .arg("simulate")
        .arg(file)
        .arg("--out")
        .arg(folder.path());
    let out = Out::of(simulate);
    assert_eq!(out.code, 0, "{}", out.stderr);
    let set = std::fs::read_to_string(folder.path().join("set.yaml")).unwrap();
    passes("set", &set);
    assert!(
        set.contains("robot: demo_arm.urdf") && set.contains("- touched.mcap"),
        "{set}"
    );
    let mut calibrate = tauscope();
    calibrate
        .arg("calibrate")
        .arg("--robot")
        .arg(robot)
        .arg(folder.path().join("free.mcap"));
    calibrate.arg("--out").arg(folder.path().join("twin.yaml"));
    let out = Out::of(calibrate);
    assert_eq!(out.code, 0, "{}", out.stderr);
    passes(
        "twin",
        &std::fs::read_to_string(folder.path().join("twin.yaml")).unwrap(),
    );
}

#[test]
fn the_bundled_files_pass_the_check() {
    for (kind, file) in [
        ("scenario", "demo.scenario.yaml"),
        ("twin", "demo.twin.yaml"),
    ] {
        passes(
            kind,
            &std::fs::read_to_string(bundled().join(file)).unwrap(),
        );
    }
    for name in ["assembly", "cyclic", "paths"] {
        let file = root().join(format!("examples/scenarios/{name}.yaml"));
        let mut command = tauscope();
        command.args(["check", "--kind", "scenario"]).arg(file);
        let out = Out::of(command);
        assert_eq!(out.code, 0, "{name}: {}", out.stderr);
    }
    let mut command = tauscope();
    command.current_dir(root()).arg("check");
    assert_eq!(Out::of(command).code, 0);
}

/// The tables of simulators stand behind the mark and end the page.
#[test]
fn the_page_of_simulators_has_the_tables_of_the_effects() {
    let path = root().join("docs/simulators.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let tables = tauscope_report::models::table();
    let (_, found) = page.split_once("## Elements by simulator\n\n").unwrap();
    assert!(
        found == tables,
        "docs/simulators.md is behind the effects; its last section is to be:\n{tables}"
    );
}

#[test]
fn the_page_of_keys_is_what_the_program_says() {
    let page = std::fs::read_to_string(root().join("docs/keys.md")).unwrap();
    let (intro, _) = page.split_once("## ").unwrap();
    let kinds = ["pipeline", "twin", "case", "set", "scenario"];
    let tables = kinds.map(|kind| {
        let keys = Out::answer(["schema", kind, "--keys"]);
        assert_eq!(keys.code, 0, "{keys:?}");
        format!("## {kind}\n\n{}", keys.stdout)
    });
    let expected = format!("{intro}{}", tables.join("\n"));
    assert!(
        page == expected,
        "docs/keys.md is behind the types: run docs/keys.sh"
    );
}
