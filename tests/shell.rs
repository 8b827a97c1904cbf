//! Completions for shells and manual pages.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::process::Command;

use crate::common::Out;

/// The commands that `tauscope --help` lists.
fn commands() -> Vec<String> {
    let help = Out::answer(["--help"]).stdout;
    let listed = help.split("Commands:\n").nth(1).unwrap();
    let listed = listed.split("\n\n").next().unwrap().lines();
    let names = listed.filter_map(|line| line.split_whitespace().next());
    names
        .filter(|name| *name != "help")
        .map(str::to_owned)
        .collect()
}

/// Completions of `typed` by bash.
fn completed(script: &str, typed: &str) -> Vec<String> {
    let words: Vec<&str> = typed.split(' ').collect();
    let (last, before) = (words[words.len() - 1], words[words.len() - 2]);
    let asked = format!(
        "{script}\nCOMP_WORDS=({typed}); COMP_CWORD={}; _tauscope tauscope '{last}' '{before}'; echo \"${{COMPREPLY[@]}}\"",
        words.len() - 1,
    );
    let answer = Command::new("bash").args(["-c", &asked]).output().unwrap();
    let answer = String::from_utf8(answer.stdout).unwrap();
    answer.split_whitespace().map(str::to_owned).collect()
}

#[test]
fn bash_completes_commands_and_options() {
    let script = Out::answer(["completions", "bash"]);
    assert_eq!(script.code, 0, "{script:?}");
    assert_eq!(
        completed(&script.stdout, "tauscope exp"),
        ["explain", "export"]
    );
    assert_eq!(
        completed(&script.stdout, "tauscope explain --hold"),
        ["--holdout"]
    );
    for shell in ["zsh", "fish"] {
        let script = Out::answer(["completions", shell]);
        for command in commands() {
            assert!(script.stdout.contains(&command), "{shell}: {command}");
        }
    }
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("man");
    let written = Out::answer(["man", "--out", out.to_str().unwrap()]);
    assert_eq!(written.code, 0, "{written:?}");
    let commands = commands();
    assert!(commands.len() > 10, "{commands:?}");
    for command in &commands {
        let page = std::fs::read_to_string(out.join(format!("tauscope-{command}.1"))).unwrap();
        assert!(page.contains(".SH SYNOPSIS"), "{command}");
    }
    // The program's own page and one per command, none for internal commands.
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), commands.len() + 1);
}

#[test]
fn a_program_that_is_built_apart_and_is_not_there_is_told_with_what_builds_it() {
    let empty = tempfile::tempdir().unwrap();
    for (command, program) in [("query", "tauscope-query"), ("cluster", "tauscope-cluster")] {
        let mut asked = crate::common::tauscope();
        let beside = std::path::Path::new(asked.get_program()).with_file_name(program);
        if beside.exists() {
            crate::common::skipped(
                "a missing program",
                &format!("{} is there", beside.display()),
            );
            continue;
        }
        let out = Out::of({
            asked.arg(command).arg("query").env("PATH", empty.path());
            asked
        });
        assert_eq!(out.code, 2, "{out:?}");
        assert!(out.stderr.contains(&format!("-p {program}")), "{out:?}");
        // Its purpose is documented even if the other program is missing.
        let mut asked = crate::common::tauscope();
        asked.arg(command).arg("--help").env("PATH", empty.path());
        let help = Out::of(asked);
        assert_eq!(help.code, 0, "{help:?}");
        assert!(help.stdout.contains(&format!("-p {program}")), "{help:?}");
    }
}
