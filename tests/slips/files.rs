//! A file of another kind than the command wants.

use super::{Slip, type_all};

const SLIPS: &[Slip] = &[
    Slip {
        typed: "info @nowhere.mcap",
        code: 2,
        says: &["there is no file", "nowhere.mcap"],
    },
    Slip {
        typed: "info @folder",
        code: 2,
        says: &["folder", "metadata.yaml"],
    },
    Slip {
        typed: "info @empty.mcap",
        code: 2,
        says: &["the file is empty"],
    },
    Slip {
        typed: "info @stub.mcap",
        code: 2,
        says: &["torn"],
    },
    Slip {
        typed: "info @words.mcap",
        code: 2,
        says: &["not a recording"],
    },
    Slip {
        typed: "info @demo_arm.urdf",
        code: 2,
        says: &["not a recording", "URDF"],
    },
    Slip {
        typed: "info @ros1.bag",
        code: 2,
        says: &["ros1.bag", "ends within its header"],
    },
    Slip {
        typed: "info @table.csv",
        code: 2,
        says: &["table.columns.yaml", "position: {first: 2}"],
    },
    Slip {
        typed: "repair @words.mcap",
        code: 2,
        says: &["not a recording"],
    },
    Slip {
        typed: "repair @nowhere.mcap",
        code: 2,
        says: &["there is no file"],
    },
    Slip {
        typed: "check @nowhere.yaml",
        code: 2,
        says: &["there is no such file", "nowhere.yaml"],
    },
    Slip {
        typed: "check @demo_arm.urdf",
        code: 2,
        says: &["URDF", "pipeline"],
    },
    Slip {
        typed: "check @demo.mcap",
        code: 2,
        says: &["an MCAP recording", "pipeline"],
    },
    Slip {
        typed: "check @folder",
        code: 2,
        says: &["a folder"],
    },
    Slip {
        typed: "check @empty.mcap",
        code: 2,
        says: &["error"],
    },
    Slip {
        typed: "run @demo.mcap",
        code: 2,
        says: &["an MCAP recording"],
    },
    Slip {
        typed: "run @nowhere.yaml",
        code: 2,
        says: &["there is no such file"],
    },
    Slip {
        typed: "explain @demo.mcap --out @x",
        code: 2,
        says: &["neither a robot", "--robot"],
    },
    Slip {
        typed: "explain @nowhere.yaml --out @x",
        code: 2,
        says: &["there is no such file"],
    },
    Slip {
        typed: "explain @pipeline.yaml --out @x",
        code: 2,
        says: &["pipeline.yaml:", "`case`"],
    },
    Slip {
        typed: "evaluate @pipeline.yaml --out @x",
        code: 2,
        says: &["pipeline.yaml:", "`set`"],
    },
    Slip {
        typed: "simulate @pipeline.yaml --out @x",
        code: 2,
        says: &["pipeline.yaml:", "`recordings`"],
    },
    Slip {
        typed: "simulate @demo.mcap --out @x",
        code: 2,
        says: &["an MCAP recording"],
    },
    Slip {
        typed: "calibrate --robot @demo.mcap @demo.mcap --out @x.yaml",
        code: 2,
        says: &["an MCAP recording"],
    },
    Slip {
        typed: "calibrate --robot @nowhere.urdf @demo.mcap --out @x.yaml",
        code: 2,
        says: &["there is no file"],
    },
    Slip {
        typed: "calibrate --robot @broken.urdf @demo.mcap --out @x.yaml",
        code: 2,
        says: &["cannot use the URDF"],
    },
    Slip {
        typed: "calibrate --robot @demo_arm.urdf @demo_arm.urdf --out @x.yaml",
        code: 2,
        says: &["URDF"],
    },
    Slip {
        typed: "init @demo.mcap @demo_validation.mcap --robot @demo.mcap --out @x",
        code: 2,
        says: &["an MCAP recording"],
    },
    Slip {
        typed: "init @demo_arm.urdf @demo.mcap --robot @demo_arm.urdf --out @x",
        code: 2,
        says: &["not a recording", "URDF"],
    },
    Slip {
        typed: "replay @demo.mcap --pipeline @demo_arm.urdf --out @x",
        code: 2,
        says: &["URDF"],
    },
    Slip {
        typed: "replay @demo_arm.urdf --pipeline @pipeline.yaml --out @x",
        code: 2,
        says: &["not a recording"],
    },
    Slip {
        typed: "replay @demo.mcap --pipeline @pipeline.yaml --out @demo.mcap",
        code: 2,
        says: &["demo.mcap"],
    },
];

#[test]
fn what_the_file_is_instead_is_said() {
    type_all(SLIPS);
}
