//! Files: recordings, robots, and what people write.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use tauscope_archive::ros::JointState;
use tauscope_archive::{Info, recordings_at, repair};
use tauscope_dynamics::{Model, check_bodies, with_plausible_bodies};
use tauscope_pipeline::pipeline::Pipeline;
use tauscope_pipeline::yaml;
use tauscope_session::Survey;
use tauscope_twin::TwinFile;

/// The data that comes with tauscope.
pub const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../data");

/// A file of this name with these bytes, in a folder of this process that holds the bundled robot and twin.
fn file(name: &str, bytes: &[u8]) -> PathBuf {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for name in ["demo_arm.urdf", "demo.twin.yaml"] {
            fs::copy(Path::new(DATA).join(name), folder.path().join(name)).expect("bundled data");
        }
        folder
    });
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("room in the temporary folder");
    path
}

fn recording(path: &Path) {
    let Ok(recording) = tauscope_session::open(path) else {
        return;
    };
    let _ = Info::read(&recording).map(|info| info.has_lost_data());
    if let Ok(mut messages) = recording.all_messages() {
        while let Some(message) = messages.next_message() {
            let _ = message.map(|message| message.decode::<JointState>());
        }
    }
    for topic in recording.topics() {
        let Ok(mut states) = recording.joint_states(&topic.name) else {
            continue;
        };
        while states.next_state().is_some_and(|state| state.is_ok()) {}
        if let Ok(survey) = Survey::of(&recording, &topic.name) {
            let _ = survey.findings.iter().map(ToString::to_string).count();
        }
    }
}

/// An archive: opened, summed up, read, and repaired.
pub fn mcap(bytes: &[u8]) {
    let path = file("a.mcap", bytes);
    recording(&path);
    // A repair waits for the disk: now and then.
    if bytes.len().is_multiple_of(16) {
        let to = path.with_file_name("repaired.mcap");
        let _ = repair(&[&path], &to);
        let _ = fs::remove_file(&to);
    }
}

/// A bag of ROS 1: opened, summed up, read.
pub fn ros1_bag(bytes: &[u8]) {
    recording(&file("a.bag", bytes));
}

/// An episode of a LeRobot data set: its rows, or what describes them.
pub fn lerobot(bytes: &[u8]) {
    const SET: &str = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../archive/tests/data/lerobot/encodings"
    );
    const INFO: &str = "meta/info.json";
    const ROWS: &str = "data/chunk-000/episode_000000.parquet";
    static WHOLE: OnceLock<[Vec<u8>; 2]> = OnceLock::new();
    let whole = WHOLE.get_or_init(|| {
        [INFO, ROWS].map(|name| fs::read(Path::new(SET).join(name)).expect("the archive's data"))
    });
    let is_info = bytes.trim_ascii_start().starts_with(b"{");
    let set = file("set", b"").with_file_name("lerobot");
    for folder in ["meta", "data/chunk-000"] {
        fs::create_dir_all(set.join(folder)).expect("room in the temporary folder");
    }
    for (name, own, whole) in [(INFO, is_info, &whole[0]), (ROWS, !is_info, &whole[1])] {
        let bytes = if own { bytes } else { whole };
        fs::write(set.join(name), bytes).expect("room in the temporary folder");
    }
    let _ = recordings_at(&set);
    recording(&set.join("episode_000000"));
    recording(&set.join(ROWS));
}

/// A table.
pub fn csv(bytes: &[u8]) {
    recording(&file("a.csv", bytes));
}

/// A pipeline file, with the robot and the twin that it names.
pub fn pipeline(bytes: &[u8]) {
    let path = file("pipeline.yaml", bytes);
    if let Err(report) = Pipeline::load(&path, None) {
        let _ = report.to_string();
    }
}

/// A `twin.yaml`, for the bundled robot.
pub fn twin(bytes: &[u8]) {
    static MODEL: OnceLock<Model> = OnceLock::new();
    let model = MODEL.get_or_init(|| {
        let urdf = fs::read_to_string(Path::new(DATA).join("demo_arm.urdf")).expect("bundled data");
        Model::from_urdf(&urdf).expect("the bundled robot")
    });
    let text = String::from_utf8_lossy(bytes).into_owned();
    let Ok(file) = yaml::parse::<TwinFile>(Path::new("twin.yaml"), text) else {
        return;
    };
    let joint_names: Vec<String> = model.joint_names().map(str::to_owned).collect();
    let Ok(correction) = file.value.resolve(&joint_names, "Nm") else {
        return;
    };
    let setup = tauscope_twin::Setup {
        model: Some(model.clone()),
        joint_names,
        torque_constants_nm_per_a: None,
        tool_link: None,
    };
    let config = tauscope_twin::Config::default();
    let config = config
        .clone()
        .with(config.filters(Some(file.value.filters)));
    let _ = tauscope_twin::Twin::new(&config, setup, correction);
}

/// A robot.
pub fn urdf(bytes: &[u8]) {
    let xml = String::from_utf8_lossy(bytes);
    let _ = Model::from_urdf(&xml);
    if let Ok(findings) = check_bodies(&xml) {
        let _ = with_plausible_bodies(&xml, &findings);
    }
}
