//! Recordings that do not fit what is asked of them.

use super::{Slip, type_all};

const SLIPS: &[Slip] = &[
    Slip {
        typed: "replay @demo.mcap @empty.mcap --pipeline @pipeline.yaml --out @x1",
        code: 2,
        says: &["empty.mcap"],
    },
    Slip {
        typed: "replay @demo.mcap @demo.mcap --pipeline @pipeline.yaml --out @x2",
        code: 2,
        says: &["results of one name"],
    },
    Slip {
        typed: "replay @torn.mcap --pipeline @pipeline.yaml --out @x3",
        code: 3,
        says: &["torn"],
    },
    Slip {
        typed: "calibrate --robot @demo_arm.urdf @demo.mcap --state-topic /joint_state --out @x.yaml",
        code: 2,
        says: &["/joint_state", "it has /joint_states"],
    },
    Slip {
        typed: "calibrate --robot @other.urdf @demo.mcap --out @x.yaml",
        code: 2,
        says: &["axis_1", "joint1"],
    },
    Slip {
        typed: "calibrate --robot @demo_arm.urdf @demo.mcap --velocity-cutoff-hz 80 --out @x.yaml",
        code: 2,
        says: &["half the rate", "less than 50"],
    },
    Slip {
        typed: "explain --robot @other.urdf --fit @demo.mcap @demo_validation.mcap --out @x4",
        code: 2,
        says: &["axis_1", "joint1"],
    },
    Slip {
        typed: "explain --robot @demo_arm.urdf --fit @demo.mcap @demo_validation.mcap --holdout @demo.mcap --out @x5",
        code: 2,
        says: &["named twice"],
    },
    Slip {
        typed: "explain --robot @demo_arm.urdf --fit @demo.mcap @empty.mcap --out @x6",
        code: 2,
        says: &["the file is empty"],
    },
    Slip {
        typed: "explain --robot @demo_arm.urdf --fit @demo.mcap @demo_validation.mcap --twin @pipeline.yaml --out @x8",
        code: 2,
        says: &["`robot` is missing"],
    },
    Slip {
        typed: "init @demo.mcap --robot @demo_arm.urdf --out @x9",
        code: 2,
        says: &["one recording is too few"],
    },
    Slip {
        typed: "init @demo.mcap @demo_validation.mcap --robot @other.urdf --out @x10",
        code: 2,
        says: &["axis_1", "name joint1"],
    },
    Slip {
        typed: "init @demo.mcap @nowhere.mcap --robot @demo_arm.urdf --out @x11",
        code: 2,
        says: &["there is no recording", "nowhere.mcap"],
    },
    Slip {
        typed: "info @torn.mcap",
        code: 3,
        says: &["torn"],
    },
    Slip {
        typed: "repair @torn.mcap",
        code: 3,
        says: &["torn.repaired.mcap"],
    },
];

#[test]
fn what_does_not_fit_is_named_with_what_is_there() {
    type_all(SLIPS);
}
