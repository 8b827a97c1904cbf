//! Recordings with impossible values, made from a bundled one.

use std::path::Path;

use tauscope_archive::ros::JointState;
use tauscope_archive::{Compression, McapWriter, Recording};

use super::{Slip, bundled, type_all};

/// Writes a contact-free recording with its values changed by `spoil`, which receives the message's number.
fn write(path: &Path, spoil: &dyn Fn(u64, &mut JointState)) {
    let recording = Recording::open(bundled().join("demo_train_sweep.mcap")).unwrap();
    let none = std::collections::BTreeMap::new();
    let mut writer = McapWriter::create(path, Compression::Zstd, &none).unwrap();
    let topic = writer.add_topic::<JointState>("/joint_states").unwrap();
    let mut states = recording.joint_states("/joint_states").unwrap();
    let mut number = 0;
    while let Some(state) = states.next_state() {
        let mut message = state.unwrap().message.clone();
        let ns = message.header.stamp.ns();
        spoil(number, &mut message);
        number += 1;
        writer.write(topic, ns, ns, &message).unwrap();
    }
    writer.finish().unwrap();
}

fn scaled(values: &mut [f64], factor: f64) {
    for value in values.iter_mut() {
        *value *= factor;
    }
}

/// Writes all recordings into `folder`.
pub fn write_all(folder: &Path) {
    let write = |name: &str, spoil: &dyn Fn(u64, &mut JointState)| {
        write(&folder.join(name), spoil);
    };
    write("zero.mcap", &|_, state| scaled(&mut state.effort, 0.0));
    write("ceased.mcap", &|number, state| {
        if number > 1000 {
            state.effort.fill(0.0);
        }
    });
    write("one_zero.mcap", &|_, state| state.effort[1] = 0.0);
    write("degrees.mcap", &|_, state| {
        scaled(&mut state.position, 57.295_779_513);
    });
    write("half.mcap", &|_, state| scaled(&mut state.velocity, 0.5));
    write("turned.mcap", &|_, state| scaled(&mut state.effort, -1.0));
    write("amperes.mcap", &|_, state| scaled(&mut state.effort, 0.1));
    write("milliamperes.mcap", &|_, state| {
        scaled(&mut state.effort, 100.0);
    });
    write("nan.mcap", &|number, state| {
        if (100..110).contains(&number) {
            state.effort[1] = f64::NAN;
        }
    });
    write("jump.mcap", &|number, state| {
        if number == 500 {
            state.position[1] += 1.5;
        }
    });
    let urdf = std::fs::read_to_string(bundled().join("demo_arm.urdf")).unwrap();
    let in_grams = |part: &str| {
        let (mass_kg, rest) = part.split_once('"').unwrap();
        format!(
            "mass value=\"{}\"{rest}",
            1000.0 * mass_kg.parse::<f64>().unwrap()
        )
    };
    let mut parts = urdf.split("mass value=\"");
    let first = parts.next().unwrap_or_default().to_owned();
    let grams: String = std::iter::once(first).chain(parts.map(in_grams)).collect();
    std::fs::write(folder.join("grams.urdf"), grams).unwrap();
    write("twice.mcap", &|_, state| {
        state.name[2] = state.name[1].clone();
    });
    write("standing.mcap", &|_, state| {
        scaled(&mut state.position, 0.0);
        scaled(&mut state.velocity, 0.0);
    });
}

const SLIPS: &[Slip] = &[
    Slip {
        typed: "info @nan.mcap",
        code: 0,
        says: &[
            "NaN in 10 messages",
            "the effort of joint2 is NaN in 10 messages from 1.000 s to 1.090 s",
        ],
    },
    Slip {
        typed: "info @jump.mcap",
        code: 0,
        says: &[
            "the position of joint2 jumps by 1.50",
            "at 5.000 s, and back after 0.010 s",
        ],
    },
    Slip {
        typed: "replay @jump.mcap --pipeline @pipeline.yaml",
        code: 0,
        says: &[
            "warning: the position of joint2 jumps by 1.50",
            "at 5.000 s",
        ],
    },
    Slip {
        typed: "info @twice.mcap",
        code: 0,
        says: &["messages name joint `joint2` twice, as entries 2 and 3 of `name`"],
    },
    Slip {
        typed: "replay @twice.mcap --pipeline @pipeline.yaml",
        code: 2,
        says: &[
            "twice.mcap",
            "name joint `joint2` twice, as entries 2 and 3 of `name`",
        ],
    },
    Slip {
        typed: "replay @zero.mcap --pipeline @pipeline.yaml",
        code: 0,
        says: &["warning: the effort is zero throughout, so it is not measured"],
    },
    Slip {
        typed: "replay @ceased.mcap --pipeline @pipeline.yaml",
        code: 0,
        says: &["no effort is measured from 10.0 s on"],
    },
    Slip {
        typed: "replay @one_zero.mcap --pipeline @pipeline.yaml --json",
        code: 0,
        says: &["the effort of joint2 is zero throughout"],
    },
    Slip {
        typed: "replay @degrees.mcap --pipeline @pipeline.yaml",
        code: 0,
        says: &["warning: the positions of joint1", "are in degrees"],
    },
    Slip {
        typed: "replay @half.mcap --pipeline @pipeline.yaml",
        code: 0,
        says: &[
            "warning: the recorded velocity of all 7 joints",
            "is 0.50 times the derivative",
        ],
    },
    Slip {
        typed: "replay @turned.mcap --pipeline @pipeline.yaml",
        code: 0,
        says: &["joint2", "has the other sign than the twin's"],
    },
    Slip {
        typed: "replay @demo.mcap --pipeline @moved.yaml",
        code: 0,
        says: &["naive_difference"],
    },
    Slip {
        typed: "check @moved.yaml",
        code: 2,
        says: &["there is no recording"],
    },
    Slip {
        typed: "replay @demo.mcap --pipeline @cut.yaml",
        code: 0,
        says: &[
            "`effort_cutoff_hz` 80 would pass everything",
            "less than 50.0",
        ],
    },
    Slip {
        typed: "check @cut.yaml",
        code: 0,
        says: &[
            "`effort_cutoff_hz` 80 would pass everything",
            "less than 50",
        ],
    },
    Slip {
        typed: "check @rtde.yaml",
        code: 2,
        says: &["motor currents", "effort: actual_current", "effort_unit: A"],
    },
    Slip {
        typed: "calibrate @zero.mcap --robot @demo_arm.urdf --effort-unit A --out @x.yaml",
        code: 2,
        says: &["the effort is zero throughout"],
    },
    Slip {
        typed: "calibrate @degrees.mcap --robot @demo_arm.urdf --effort-unit A --out @x.yaml",
        code: 2,
        says: &["are in degrees"],
    },
    Slip {
        typed: "calibrate @standing.mcap --robot @demo_arm.urdf --effort-unit A --out @x.yaml",
        code: 2,
        says: &["the arm is at rest", "torque constants"],
    },
    Slip {
        typed: "calibrate @turned.mcap --robot @demo_arm.urdf --effort-unit A --out @x.yaml",
        code: 2,
        says: &["joint2", "other sign"],
    },
    Slip {
        typed: "calibrate @milliamperes.mcap --robot @demo_arm.urdf --effort-unit A --out @x.yaml",
        code: 2,
        says: &["mA must divide by 1000"],
    },
    Slip {
        typed: "calibrate @demo_validation.mcap --robot @demo_arm.urdf --out @demo_validation.mcap --force",
        code: 2,
        says: &["would overwrite"],
    },
    Slip {
        typed: "calibrate @demo_validation.mcap --robot @demo_arm.urdf --out @demo_arm.urdf --force",
        code: 2,
        says: &["would overwrite"],
    },
    Slip {
        typed: "manifest @demo.mcap --out @demo.mcap --force",
        code: 2,
        says: &["would overwrite"],
    },
    Slip {
        typed: "init @zero.mcap @demo_validation.mcap --robot @demo_arm.urdf --out @x12",
        code: 2,
        says: &["zero.mcap", "the effort is zero throughout"],
    },
    Slip {
        typed: "init @turned.mcap @demo_validation.mcap --robot @demo_arm.urdf --out @x12",
        code: 2,
        says: &["other sign"],
    },
    Slip {
        typed: "init @demo.mcap @demo_validation.mcap --robot @grams.urdf --out @x16",
        code: 0,
        says: &["grams.urdf", "probably in g: convert them to kg"],
    },
    Slip {
        typed: "init @degrees.mcap @demo_validation.mcap --robot @demo_arm.urdf --out @x12",
        code: 2,
        says: &["degrees.mcap", "are in degrees"],
    },
    Slip {
        typed: "calibrate @half.mcap --robot @demo_arm.urdf --out @x13.yaml",
        code: 0,
        says: &[
            "warning: ",
            "half.mcap: the recorded velocity of all 7 joints",
        ],
    },
];

#[test]
fn what_cannot_be_is_said() {
    type_all(SLIPS);
}

#[test]
fn a_run_warns_once_of_what_cannot_be() {
    let desk = super::Desk::new();
    let text = std::fs::read_to_string(desk.path("pipeline.yaml")).unwrap();
    for (name, code, wanted) in [
        ("zero.mcap", 0, "the effort is zero throughout"),
        ("degrees.mcap", 0, "are in degrees"),
        ("turned.mcap", 0, "other sign than the twin's"),
        ("jump.mcap", 0, "the position of joint2 jumps by 1.50"),
        // Unusable messages are lost.
        (
            "nan.mcap",
            3,
            "nan.mcap: the effort of joint2 is NaN in 10 messages from 1.000 s to 1.090 s",
        ),
    ] {
        let file = desk.path("spoilt.yaml");
        std::fs::write(&file, text.replace("demo.mcap", name)).unwrap();
        let mut run = crate::common::tauscope();
        run.args(["run", "-q"]).arg(&file);
        let out = super::Out::of(run);
        let told = out.stderr.matches(wanted).count();
        assert_eq!((out.code, told), (code, 1), "{name}: {out:?}");
    }
    let mut run = crate::common::tauscope();
    run.args(["run", "-q"]).arg(desk.path("pipeline.yaml"));
    let sound = super::Out::of(run);
    assert!(!sound.stderr.contains("WARN"), "{sound:?}");
}

/// A table is replayed with the same column file that the other commands use.
#[test]
fn a_table_is_replayed() {
    let desk = super::Desk::new();
    let recording = Recording::open(desk.path("demo.mcap")).unwrap();
    let mut states = recording.joint_states("/joint_states").unwrap();
    let (mut rows, mut joints) = (String::new(), Vec::new());
    while let Some(state) = states.next_state() {
        let message = &state.unwrap().message;
        let values = [&message.position, &message.velocity, &message.effort];
        let values = values.into_iter().flatten().map(f64::to_string);
        let t = message.header.stamp.ns() as f64 * 1e-9;
        let row: Vec<String> = std::iter::once(t.to_string()).chain(values).collect();
        rows += &(row.join(",") + "\n");
        joints.clone_from(&message.name);
    }
    std::fs::write(desk.path("arm.csv"), rows).unwrap();
    let count = joints.len();
    let columns = format!(
        "time: {{number: 1}}\nposition: {{first: 2}}\nvelocity: {{first: {}}}\neffort: {{first: {}}}\njoints: [{}]\n",
        2 + count,
        2 + 2 * count,
        joints.join(", ")
    );
    std::fs::write(desk.path("arm.columns.yaml"), columns).unwrap();
    let events = |name: &str| {
        let typed = format!("replay @{name} --pipeline @pipeline.yaml --json");
        let out = desk.answer(&typed);
        assert_eq!(out.code, 0, "{}", out.stderr);
        out.stdout.matches("\"t_off\"").count()
    };
    assert_eq!(events("arm.csv"), events("demo.mcap"));
}
