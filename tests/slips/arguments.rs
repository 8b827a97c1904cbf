//! Names and numbers that are mistyped.

use super::{Slip, type_all};

const SLIPS: &[Slip] = &[
    Slip {
        typed: "explian",
        code: 2,
        says: &["explain"],
    },
    Slip {
        typed: "schema pipline",
        code: 2,
        says: &["pipeline"],
    },
    Slip {
        typed: "run @pipeline.yaml --host mars",
        code: 2,
        says: &["no host `mars`", "leave `--host` out"],
    },
    Slip {
        typed: "replay @demo.mcap --pipeline @pipeline.yaml --jobs 0 --out @x",
        code: 2,
        says: &["1..=256"],
    },
    Slip {
        typed: "replay @demo.mcap --pipeline @pipeline.yaml --source injest --out @x",
        code: 2,
        says: &["injest"],
    },
    Slip {
        typed: "calibrate @demo.mcap",
        code: 2,
        says: &["--robot <URDF>"],
    },
    Slip {
        typed: "calibrate --robot @demo_arm.urdf @demo.mcap --effort-unit mA --out @x.yaml",
        code: 2,
        says: &["Nm, A"],
    },
    Slip {
        typed: "calibrate --robot @demo_arm.urdf @demo.mcap --torque-constant joint1=10 --out @x.yaml",
        code: 2,
        says: &["the effort is in Nm"],
    },
    Slip {
        typed: "calibrate --robot @demo_arm.urdf @demo.mcap --effort-unit A --torque-constant jiont1=10 --out @x.yaml",
        code: 2,
        says: &["did you mean `joint1`"],
    },
    Slip {
        typed: "calibrate --robot @demo_arm.urdf @demo.mcap --effort-unit A --torque-constant joint1=0 --out @x.yaml",
        code: 2,
        says: &["no positive number"],
    },
    Slip {
        typed: "calibrate --robot @demo_arm.urdf @demo.mcap --motion comanded --out @x.yaml",
        code: 2,
        says: &["commanded"],
    },
    Slip {
        typed: "explain --robot @demo_arm.urdf --fit @demo.mcap @demo_validation.mcap --without coulomb --out @x",
        code: 2,
        says: &["did you mean `coulomb_friction`"],
    },
    Slip {
        typed: "explain --fit @demo.mcap @demo_validation.mcap --out @x",
        code: 2,
        says: &["--robot URDF"],
    },
    Slip {
        typed: "explain @demo.mcap @demo_validation.mcap --out @x",
        code: 2,
        says: &["--robot URDF"],
    },
    Slip {
        typed: "explain @case.yaml --robot @demo_arm.urdf --out @x",
        code: 2,
        says: &["--robot goes with recordings, not with a case"],
    },
    Slip {
        typed: "init --robot @demo_arm.urdf",
        code: 2,
        says: &["<RECORDING>"],
    },
    Slip {
        typed: "init @demo.mcap",
        code: 2,
        says: &["--robot <URDF>"],
    },
];

#[test]
fn what_was_meant_is_suggested() {
    type_all(SLIPS);
}
