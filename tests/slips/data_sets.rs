//! LeRobot data sets that lack something, and slips in naming an episode.

use super::{Slip, type_all};

const SLIPS: &[Slip] = &[
    Slip {
        typed: "info @so101",
        code: 0,
        says: &["shoulder_pan", "no efforts", "observation.effort"],
    },
    Slip {
        typed: "calibrate --robot @demo_arm.urdf @so101 --out @x.yaml",
        code: 2,
        says: &["no efforts", "so101.columns.yaml"],
    },
    Slip {
        typed: "replay @so101/episode_000000 --pipeline @pipeline.yaml --out @x",
        code: 2,
        says: &["no efforts", "so101.columns.yaml"],
    },
    Slip {
        typed: "explain --robot @demo_arm.urdf --fit @so101 @demo.mcap --out @x",
        code: 2,
        says: &["no efforts", "so101.columns.yaml"],
    },
    Slip {
        typed: "init @so101 @so101/episode_000000 --robot @demo_arm.urdf --out @x",
        code: 2,
        says: &["no efforts", "so101.columns.yaml"],
    },
    Slip {
        typed: "info @aloha",
        code: 2,
        says: &["2 episodes", "aloha/episode_000000"],
    },
    Slip {
        typed: "info @aloha/episode_000009",
        code: 2,
        says: &["no episode 9", "episode_000001"],
    },
    Slip {
        typed: "info @nowhere/episode_000009",
        code: 2,
        says: &["there is no file"],
    },
    Slip {
        typed: "info @openarm/data/chunk-000/file-000.parquet",
        code: 2,
        says: &["2 episodes", "openarm/episode_000000"],
    },
    Slip {
        typed: "info @no_meta",
        code: 2,
        says: &["no meta/info.json", "download"],
    },
    Slip {
        typed: "info @no_meta/data/chunk-000/episode_000000.parquet",
        code: 2,
        says: &["LeRobot data set", "meta/info.json"],
    },
    Slip {
        typed: "info @torn/episode_000000",
        code: 2,
        says: &["episode_000000.parquet", "torn"],
    },
    Slip {
        typed: "info @torn/episode_000001",
        code: 2,
        says: &["episode_000001.parquet"],
    },
    Slip {
        typed: "info @openarm/episode_000000",
        code: 0,
        says: &["degrees: true", "openarm.columns.yaml"],
    },
    Slip {
        typed: "calibrate --robot @demo_arm.urdf @openarm --out @x.yaml",
        code: 2,
        says: &["degrees: true", "openarm.columns.yaml"],
    },
    Slip {
        typed: "calibrate --robot @demo_arm.urdf @aloha --out @x.yaml",
        code: 2,
        says: &["names no joint1", "left_waist", "aloha.columns.yaml"],
    },
    Slip {
        typed: "info @unnamed",
        code: 2,
        says: &["unnamed.columns.yaml", "observation.nothing"],
    },
];

#[test]
fn what_a_data_set_lacks_is_said_at_once() {
    type_all(SLIPS);
}
