//! `tauscope check`: reports all errors at once, each with its place, and starts nothing.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::Path;

use crate::common::{Out, bundled, tauscope, write};

fn check(folder: &Path, text: &str, more: &[&str]) -> Out {
    std::fs::copy(bundled().join("demo_arm.urdf"), folder.join("arm.urdf")).unwrap();
    let file = write(&folder.join("pipeline.yaml"), text);
    let mut out = Out::answer(["check", file.to_str().unwrap()].iter().chain(more));
    // Errors name files by the path that was given.
    out.stderr = out.stderr.replace(&format!("{}/", folder.display()), "");
    out
}

/// Error output for an invalid file.
fn errors(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let out = check(folder.path(), text, &[]);
    assert_eq!((out.code, out.stdout.as_str()), (2, ""), "{}", out.stderr);
    out.stderr
}

/// A pipeline with these stages.
fn stages(lines: &str) -> String {
    format!("version: 1\ncells: {{demo: {{robot: arm.urdf}}}}\nstages:\n{lines}")
}

const GOOD: &str = "
- {name: record, inputs: [ingest, twin, detect], record: {mcap: out/x.mcap}}
- {name: detect, input: twin, keep: newest, detect: {naive_difference: {}, threshold: {score: 9}}}
- {name: twin, input: ingest, twin: {}}
- {name: ingest, ingest: {zenoh: {connect: [tcp/127.0.0.1:7447]}}}
";

#[test]
fn limits_of_a_robot_that_leave_no_room_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = std::fs::read_to_string(bundled().join("demo_arm.urdf")).unwrap();
    let begin = urdf.find("lower=").unwrap();
    let end = begin + urdf[begin..].find("upper=").unwrap();
    let reversed = format!("{}lower=\"9\" {}", &urdf[..begin], &urdf[end..]);
    write(&folder.path().join("reversed.urdf"), &reversed);
    let text = stages(GOOD).replace("arm.urdf", "reversed.urdf");
    let out = check(folder.path(), &text, &[]);
    assert_eq!(out.code, 0, "{}", out.stderr);
    let told = "warning: cell `demo`: joint `joint1` counts as unlimited";
    assert!(out.stderr.starts_with(told), "{}", out.stderr);
}

#[test]
fn the_former_key_of_a_watch_is_accepted_with_the_edit() {
    let folder = tempfile::tempdir().unwrap();
    let watch = "- {name: guard, input: twin, explain: {}}\n";
    let out = check(folder.path(), &stages(&format!("{GOOD}{watch}")), &[]);
    assert_eq!(out.code, 0, "{}", out.stderr);
    let edit =
        "warning: line 9: `explain` is the former key of a watch; in stage `guard` write `watch:`";
    assert!(out.stderr.starts_with(edit), "{}", out.stderr);
    let both = stages(&format!(
        "{GOOD}{}",
        watch.replace("explain: {}", "explain: {}, watch: {}")
    ));
    assert!(errors(&both).contains("watch"), "{}", errors(&both));
}

#[test]
fn a_good_file_is_shown_as_tables_pictures_and_json() {
    let folder = tempfile::tempdir().unwrap();
    let out = check(folder.path(), &stages(GOOD), &[]);
    assert_eq!((out.code, out.stderr.as_str()), (0, ""));
    let rows: Vec<String> = out
        .stdout
        .lines()
        .filter(|line| line.starts_with('│'))
        .map(|line| {
            line.split(['│', '┆'])
                .map(str::trim)
                .collect::<Vec<_>>()
                .join("|")
        })
        .collect();
    assert_eq!(
        rows,
        [
            "|stage|kind|cell|host|process|listens to|puts out|",
            "|ingest|ingest|demo|this one|demo||joint states|",
            "|twin|twin|demo|this one|demo|ingest|twin states|",
            "|detect|detect|demo|this one|demo|twin|detections|",
            "|record|record|demo|this one|record|ingest, twin, detect||",
            "|from|to|carries|over|keeps|",
            "|ingest|twin|joint states|the process itself|all|",
            "|twin|detect|twin states|shared memory|newest|",
            "|ingest|record|joint states|shared memory|all|",
            "|twin|record|twin states|shared memory|all|",
            "|detect|record|detections|shared memory|all|",
        ]
    );
    let mermaid = check(folder.path(), &stages(GOOD), &["--format", "mermaid"]).stdout;
    assert!(mermaid.starts_with("flowchart LR\n"), "{mermaid}");
    assert!(mermaid.contains("s1 -->|twin states| s2"), "{mermaid}");
    assert!(
        mermaid.contains("subgraph process_0 [\"demo\"]"),
        "{mermaid}"
    );
    assert!(mermaid.contains("s0 ==>|joint states| s1"), "{mermaid}");
    let dot = check(folder.path(), &stages(GOOD), &["--format", "dot"]).stdout;
    assert!(
        dot.contains("s0 -> s1 [label=\"joint states\", style=bold];"),
        "{dot}"
    );
    let json = check(folder.path(), &stages(GOOD), &["--json"]).stdout;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["links"][1]["stream"], "demo/twin");
    assert_eq!(json["links"][1]["keep"], "newest");
    assert_eq!(json["stages"][0]["process"], "demo");
}

#[test]
fn the_process_of_a_stage_is_its_own_its_cells_or_that_of_all() {
    let folder = tempfile::tempdir().unwrap();
    let processes = |more: &str, cell: &str, twin: &str| -> Vec<String> {
        let text = format!(
            "version: 1
{more}
cells: {{demo: {{robot: arm.urdf{cell}}}}}
stages:
- {{name: ingest, ingest: {{zenoh: {{connect: [tcp/127.0.0.1:7447]}}}}}}
- {{name: twin, input: ingest{twin}, twin: {{}}}}
- {{name: demo, inputs: [ingest, twin], record: {{mcap: out.mcap}}}}
"
        );
        let out = check(folder.path(), &text, &["--json"]);
        assert_eq!(out.code, 0, "{}", out.stderr);
        let json: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
        let stages = json["stages"].as_array().unwrap().iter();
        let names = stages.map(|stage| stage["process"].as_str().unwrap().to_owned());
        names.collect()
    };
    assert_eq!(processes("", "", ""), ["demo", "demo", "demo_record"]);
    let all = "process: all";
    assert_eq!(processes(all, "", ""), ["all", "all", "demo"]);
    let cell = ", process: left";
    assert_eq!(processes(all, cell, ""), ["left", "left", "demo"]);
    let own = ", process: one";
    assert_eq!(processes(all, cell, own), ["left", "one", "demo"]);
    let bad = "version: 1
cells: {demo: {robot: arm.urdf}}
stages:
- {name: mine, process: two words, outside: {command: [sleep], output: joint_state}}
";
    let out = check(folder.path(), bad, &[]);
    assert_eq!(out.code, 2);
    for said in [
        "`two words` cannot be a process's name",
        "`mine` is a program, which is a process itself",
    ] {
        assert!(out.stderr.contains(said), "{}", out.stderr);
    }
}

#[test]
fn the_structure_is_checked_all_at_once() {
    assert_eq!(
        errors(
            "version: 2
cells: {demo: {robto: arm.urdf, effort_unit: NM}}
stages:
- name: ingest
  ingest: {zenoh: {connect: tcp/localhost:7447}, rate: slow}
- {input: ingest, twin: {effort_cutoff_hz: -4}}
"
        ),
        "\
error: expected at most 1, found the number 2
 --> pipeline.yaml:1:10
  |
1 | version: 2
  |          ^ `version`

error: unknown key `robto`
 --> pipeline.yaml:2:16
  |
2 | cells: {demo: {robto: arm.urdf, effort_unit: NM}}
  |                ^^^^^
  |
  = help: did you mean `robot`?

error: expected one of `Nm`, `A`, found the text `NM`
 --> pipeline.yaml:2:46
  |
2 | cells: {demo: {robto: arm.urdf, effort_unit: NM}}
  |                                              ^^

error: expected a list, found the text `tcp/localhost:7447`
 --> pipeline.yaml:5:29
  |
5 |   ingest: {zenoh: {connect: tcp/localhost:7447}, rate: slow}
  |                             ^^^^^^^^^^^^^^^^^^ `stages[0].ingest.zenoh.connect`

error: expected `realtime` or `fast` or a number, found the text `slow`
 --> pipeline.yaml:5:56
  |
5 |   ingest: {zenoh: {connect: tcp/localhost:7447}, rate: slow}
  |                                                        ^^^^

error: the key `name` is missing in `stages[1]`
 --> pipeline.yaml:6:3
  |
6 | - {input: ingest, twin: {effort_cutoff_hz: -4}}
  |   ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
  |
  = help: `name`: The stage's name: letters, digits, `_` and `-`.

error: expected at least 0.01, found the number -4
 --> pipeline.yaml:6:44
  |
6 | - {input: ingest, twin: {effort_cutoff_hz: -4}}
  |                                            ^^ `stages[1].twin.effort_cutoff_hz`

7 errors; nothing was started
"
    );
}

#[test]
fn the_wiring_is_checked_all_at_once() {
    assert_eq!(
        errors(&stages(
            "- {name: ingest, ingest: {zenoh: {connect: [tcp/127.0.0.1:7447]}}}
- {name: twin, input: ingst, twin: {}}
- {name: twin, input: ingest, twin: {}, detect: {}}
- {name: detect, input: ingest, detect: {naive_difference: {}, threshold: {score: 9}}}
- {name: record, inputs: [twin, twin, record], record: {mcap: x.mcap}}
"
        )),
        "\
error: there is no stage `ingst`
 --> pipeline.yaml:5:23
  |
5 | - {name: twin, input: ingst, twin: {}}
  |                       ^^^^^
  |
  = help: did you mean `ingest`?

error: two stages are named `twin`
 --> pipeline.yaml:6:10
  |
5 | - {name: twin, input: ingst, twin: {}}
  |          ---- the first one
6 | - {name: twin, input: ingest, twin: {}, detect: {}}
  |          ^^^^ the second one

error: stage `twin` is two things at once
 --> pipeline.yaml:6:41
  |
6 | - {name: twin, input: ingest, twin: {}, detect: {}}
  |                               ----      ^^^^^^ `detect`
  |                               |
  |                               `twin`
  |
  = help: make two stages of it

error: a `detect` stage takes twin states, but `ingest` puts out joint states
 --> pipeline.yaml:7:25
  |
7 | - {name: detect, input: ingest, detect: {naive_difference: {}, threshold: {score: 9}}}
  |                         ^^^^^^
  |
  = help: let it listen to a `twin` stage

error: `record` listens to `twin` twice
 --> pipeline.yaml:8:33
  |
8 | - {name: record, inputs: [twin, twin, record], record: {mcap: x.mcap}}
  |                           ----  ^^^^
  |                           |
  |                           already here

error: `record` has no output stream to listen to
 --> pipeline.yaml:8:39
  |
8 | - {name: record, inputs: [twin, twin, record], record: {mcap: x.mcap}}
  |                                       ^^^^^^

error: the stages run in a circle: record -> record
 --> pipeline.yaml:8:39
  |
8 | - {name: record, inputs: [twin, twin, record], record: {mcap: x.mcap}}
  |                                       ^^^^^^
  |
  = help: a pipeline has a beginning: a stage cannot listen to what it causes

7 errors; nothing was started
"
    );
}

#[test]
fn what_is_no_endpoint_is_refused_wherever_it_stands() {
    let text = errors(
        "version: 1
cells: {demo: {robot: arm.urdf}}
hosts: {here: {listen: garbage}, there: {connect: [\"udp/10.0.0.1:7447\"]}}
stages:
- {name: a, host: here, ingest: {zenoh: {connect: [tcp/here]}, commands: {connect: [nonsense]}}}
- {name: b, host: here, input: a, twin: {}}
- {name: c, host: there, input: b, detect: {naive_difference: {}, threshold: {score: 1}}}
- {name: d, host: here, inputs: [a, c], publish: {zenoh: {listen: [tcp/x:99999]}}}
",
    );
    for part in [
        "`garbage` is no endpoint: it has the form `tcp/HOST:PORT`",
        "`udp/10.0.0.1:7447`: there is no transport `udp`, only tcp and tls",
        "`tcp/here` names no host and port",
        "`nonsense` is no endpoint",
        "`tcp/x:99999` names no host and port",
        "--> pipeline.yaml:3:",
        "--> pipeline.yaml:5:",
        "--> pipeline.yaml:8:",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn a_cycle_is_named() {
    let text = errors(&stages(
        "- {name: a, input: c, outside: {command: [cat], output: detection}}
- {name: b, input: a, outside: {command: [cat], output: detection}}
- {name: c, input: b, outside: {command: [cat], output: detection}}
",
    ));
    assert!(
        text.starts_with("error: the stages run in a circle: a -> b -> c -> a\n"),
        "{text}"
    );
}

#[test]
fn what_files_hold_is_checked_too() {
    let text = errors(&format!(
        "version: 1
cells:
  demo:
    robot: arm.urdf
    effort_unit: A
    torque_constants_nm_per_a: {{joint1: 11, jiont2: 11}}
    tool: {{link: tol}}
  sound: {{robot: arm.urdf}}
  other: {{robot: nowhere.urdf}}
  third: {{robot: pipeline.yaml}}
stages:
- {{name: a, cell: demo, ingest: {{file: {{path: nowhere.mcap}}}}}}
- {{name: b, cell: sound, ingest: {{file: {{path: {recording}, topics: {{state: /nothing}}}}}}}}
- {{name: twin, input: a, twin: {{model: nowhere.yaml}}}}
- {{name: ours, input: a, twin: {{motion: commanded}}}}
- {{name: r1, inputs: [a], record: {{mcap: out/x.mcap}}}}
- {{name: r2, inputs: [b], record: {{mcap: ./out/../out/x.mcap}}}}
- {{name: theirs, input: a, outside: {{command: [./nowhere], output: twin_state}}}}
",
        recording = bundled().join("demo.mcap").display()
    ));
    for wanted in [
        "error: no torque constant for `joint2`",
        "error: the robot has no joint `jiont2`",
        "error: the robot has no link `tol`",
        "error: cannot read the URDF: there is no file",
        "error: cannot use the URDF: ",
        "error: there is no recording nowhere.mcap",
        "no topic \"/nothing\"",
        "error: there is no twin nowhere.yaml",
        "error: the source `a` reads no `command` topic for this",
        "error: `r2` would overwrite ./out/../out/x.mcap",
        "error: there is no program ./nowhere",
    ] {
        assert!(text.contains(wanted), "`{wanted}` is missing in\n{text}");
    }
}

#[test]
fn one_low_pass_for_a_twin_that_has_them_by_joint_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let model = std::fs::read_to_string(bundled().join("demo.twin.yaml")).unwrap();
    let model = model.replacen("    gain:", "    effort_cutoff_hz: 9.0\n    gain:", 1);
    write(&folder.path().join("twin.yaml"), &model);
    let twin = |cutoff: &str| {
        stages(&format!(
            "- {{name: ingest, ingest: {{zenoh: {{connect: [tcp/127.0.0.1:7447]}}}}}}
- {{name: twin, input: ingest, twin: {{model: twin.yaml{cutoff}}}}}
"
        ))
    };
    let out = check(folder.path(), &twin(", effort_cutoff_hz: 4.5"), &[]);
    let said = "the twin's model has low-passes by joint";
    assert!(out.code == 2 && out.stderr.contains(said), "{}", out.stderr);
    let out = check(folder.path(), &twin(""), &[]);
    assert_eq!(out.code, 0, "{}", out.stderr);
}

#[test]
fn a_twin_made_for_another_robot_or_other_filters_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let model = std::fs::read_to_string(bundled().join("demo.twin.yaml")).unwrap();
    assert!(model.contains("name: demo_arm\n") && model.contains("effort_cutoff_hz: 4.5\n"));
    let model = model.replace("name: demo_arm\n", "name: other_arm\n");
    write(&folder.path().join("twin.yaml"), &model);
    let pipeline = stages(
        "- {name: ingest, ingest: {zenoh: {connect: [tcp/127.0.0.1:7447]}}}
- {name: twin, input: ingest, twin: {model: twin.yaml, effort_cutoff_hz: 5}}
",
    );
    let out = check(folder.path(), &pipeline, &[]);
    assert_eq!(
        (out.code, out.stderr.as_str()),
        (
            2,
            "\
error: this twin was made for the robot `other_arm`, not for `demo_arm`
 --> pipeline.yaml:5:45
  |
5 | - {name: twin, input: ingest, twin: {model: twin.yaml, effort_cutoff_hz: 5}}
  |                                             ^^^^^^^^^
  |
  = help: calibrate one for this robot: `tauscope calibrate`

error: `effort_cutoff_hz` is 5, but the twin's model was made with 4.5
 --> pipeline.yaml:5:74
  |
5 | - {name: twin, input: ingest, twin: {model: twin.yaml, effort_cutoff_hz: 5}}
  |                                                                          ^
  |
  = help: leave it out or give `effort_cutoff_hz: 4.5`, or calibrate anew: its thresholds hold for no other

2 errors; nothing was started
"
        )
    );
}

#[test]
fn hosts_are_checked() {
    let text = errors(
        "version: 1
cells: {demo: {robot: arm.urdf}}
hosts: {a: {listen: tcp/10.0.0.1:7447}, b: {connect: [tcp/10.0.0.1:7447]}}
stages:
- {name: ingest, host: a, ingest: {zenoh: {connect: [tcp/127.0.0.1:7447]}}}
- {name: twin, input: ingest, twin: {}}
- {name: record, host: c, inputs: [ingest], record: {mcap: x.mcap}}
",
    );
    assert!(
        text.contains("error: stage `twin` does not say on which host it runs"),
        "{text}"
    );
    assert!(text.contains("error: there is no host `c`"), "{text}");
}

#[test]
fn a_program_reads_the_errors_of_a_broken_file() {
    let folder = tempfile::tempdir().unwrap();
    let text = "version: 1
cells: {demo: {robot: nowhere.urdf}}
stages:
- {name: ingest, ingest: {file: {pth: a.mcap}}}
";
    for more in [&["--json"][..], &["--format", "json"]] {
        let out = check(folder.path(), text, more);
        assert_eq!(out.code, 2, "{out:?}");
        let said: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
        let errors = said["errors"].as_array().unwrap();
        let unknown = |error: &&serde_json::Value| error["message"] == "unknown key `pth`";
        let wrong = errors.iter().find(unknown).unwrap();
        assert_eq!(wrong["line"], 4, "{said}");
        assert!(wrong["column"].as_u64() > Some(1), "{said}");
        let file = folder.path().join("pipeline.yaml");
        assert_eq!(
            wrong["file"].as_str().map(Path::new),
            Some(&*file),
            "{said}"
        );
        assert_eq!(out.stderr, "");
    }
    let torn = check(folder.path(), "version: [", &["--json"]);
    let said: serde_json::Value = serde_json::from_str(&torn.stdout).unwrap();
    assert!(said["errors"][0]["line"].is_u64(), "{said}");
}

#[test]
fn a_recording_is_looked_for_on_the_host_that_reads_it() {
    let folder = tempfile::tempdir().unwrap();
    let text = "version: 1
cells: {demo: {robot: arm.urdf}}
hosts: {a: {listen: tcp/10.0.0.1:7447}, b: {connect: tcp/10.0.0.1:7447}}
stages:
- {name: ingest, host: a, ingest: {file: {path: only_on_a.mcap}}}
- {name: twin, host: b, input: ingest, twin: {}}
";
    assert_eq!(check(folder.path(), text, &["--host", "b"]).code, 0);
    assert_eq!(check(folder.path(), text, &["--host", "a"]).code, 2);
    assert_eq!(check(folder.path(), text, &["--host", "c"]).code, 2);
}

#[test]
fn wrong_arguments_and_files_end_with_2() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        &["run", "nowhere.yaml"][..],
        &["check", "nowhere.yaml"],
        &["check", "--pipeline", "nowhere.yaml"],
        &["run", "--pipeline", "nowhere.yaml"],
        &["info", "nowhere.mcap"],
        &["repair", "nowhere.mcap"],
        &["simulate", "nowhere.yaml", "--out", "out"],
        &["run", "--no-such-option"],
        &["no-such-command"],
        // Without an argument it is `run pipeline.yaml`, and there is none here.
        &[],
    ] {
        let mut command = tauscope();
        command.current_dir(folder.path()).args(arguments);
        let out = Out::of(command);
        assert_eq!(out.code, 2, "{arguments:?}: {}", out.stderr);
        assert!(!out.stderr.is_empty(), "{arguments:?}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn the_schema_accepts_what_check_accepts() {
    let mut command = tauscope();
    command.arg("schema");
    let schema: serde_json::Value = serde_json::from_str(&Out::of(command).stdout).unwrap();
    assert_eq!(schema["title"], "tauscope pipeline");
    let description = &schema["$defs"]["CellEntry"]["properties"]["torque_constants_nm_per_a"];
    let description = description["description"].as_str().unwrap();
    assert!(
        description.contains("[N m/A]"),
        "no Rust escapes: {description}"
    );
}
