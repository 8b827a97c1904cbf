//! Labels of a set, and their inconsistencies with the set and the robot.

use std::collections::BTreeMap;
use std::path::Path;

use tauscope_dynamics::terms::words::counted;
use tauscope_pipeline::cell::Cell;
use tauscope_pipeline::files::SetFile;
use tauscope_pipeline::report::{Problem, Report};
use tauscope_pipeline::suggest;
use tauscope_pipeline::yaml::{Located, Place};

use crate::labels::{self, LabelsFile};
use crate::recording::{Named, Role};

/// Reads the labels from the file under `labels:`, else `labels.json`, else `labels_train.json` next to the set.
pub fn find(
    file: &Located<SetFile>,
    notes: &mut Vec<String>,
    report: &mut Report,
) -> Option<LabelsFile> {
    const TRAIN: &str = "labels_train.json";
    let named = file.value.labels.as_ref().map(|path| file.resolve(path));
    let beside = |name: &str| Some(file.resolve(Path::new(name))).filter(|path| path.is_file());
    let place = Place::root().key("labels");
    let path = match named {
        Some(path) if path.is_file() => path,
        Some(path) => {
            let Some(train) = beside(TRAIN) else {
                let title = format!("there is no file {}", path.display());
                report.push(file.at(&place, title));
                return None;
            };
            notes.push(format!(
                "{} is not there; the labels are those of {}",
                path.display(),
                train.display()
            ));
            train
        }
        None => beside("labels.json").or_else(|| beside(TRAIN))?,
    };
    match labels::read(&path) {
        Ok(labels) => Some(labels),
        Err(wrong) => {
            report.push(Problem::of_file(&path, wrong));
            None
        }
    }
}

/// Notes on the labels: recordings that are only in the labels or only in the set, and links that the robot does not
/// have.
pub fn doubts(labels: Option<&LabelsFile>, recordings: &[Named], cell: &Cell) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(labels) = labels {
        let in_set = |name: &&str| recordings.iter().any(|recording| recording.name == **name);
        let names = labels.recordings.keys().map(String::as_str);
        let strangers: Vec<&str> = names.filter(|name| !in_set(name)).collect();
        if !strangers.is_empty() {
            notes.push(format!(
                "labelled, but not in the set: {}",
                suggest::some(&strangers)
            ));
        }
    }
    let tests = || (recordings.iter()).filter(|recording| recording.role == Role::Test);
    let bare: Vec<&str> = tests()
        .filter(|recording| recording.truth.is_none())
        .map(|recording| recording.name.as_str())
        .collect();
    if !bare.is_empty() && bare.len() < tests().count() {
        notes.push(format!(
            "without labels, and not scored: {}",
            suggest::some(&bare)
        ));
    }
    notes.extend(unknown_links(recordings, cell));
    notes
}

fn unknown_links(recordings: &[Named], cell: &Cell) -> Vec<String> {
    let Some(model) = &cell.model else {
        return Vec::new();
    };
    let mut unknown: BTreeMap<&str, usize> = BTreeMap::new();
    let truths = recordings
        .iter()
        .filter_map(|recording| recording.truth.as_ref());
    for link in truths
        .flat_map(|truth| &truth.events)
        .filter_map(|event| event.link.as_deref())
    {
        if model.link_index(link).is_none() {
            *unknown.entry(link).or_default() += 1;
        }
    }
    let links: Vec<&str> = model
        .links()
        .iter()
        .map(|link| link.name.as_str())
        .collect();
    let note = |(link, count): (&str, usize)| {
        let near = suggest::nearest(link, links.iter().copied())
            .map_or_else(String::new, |near| format!("did you mean `{near}`? "));
        format!(
            "labels name the link `{link}` in {}, which the robot does not have: not scored there; {near}its links are {}",
            counted(count, "contact"),
            suggest::list(links.iter().copied())
        )
    };
    unknown.into_iter().map(note).collect()
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::labels::{TrueEvent, Truth};
    use tauscope_pipeline::cell::EffortUnit;

    fn recording(name: &str, link: Option<&str>) -> Named {
        let truth = link.map(|link| Truth {
            duration: None,
            events: vec![TrueEvent {
                link: Some(link.to_owned()),
                ..TrueEvent::default()
            }],
        });
        Named {
            name: name.to_owned(),
            path: PathBuf::new(),
            role: Role::Test,
            start_ns: 0,
            truth,
        }
    }

    #[test]
    fn who_is_labelled_and_not_there_or_there_and_not_labelled_is_named() {
        let problem = |_: tauscope_pipeline::cell::ConstantSpot<'_>, title| Problem::new(title);
        let robot = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/demo_arm.urdf");
        let cell = Cell::from_urdf(&robot, EffortUnit::Nm, &BTreeMap::new(), &problem);
        let (Ok(cell), text) = (cell, r#"{"recordings": {"a": {}, "typo": {}}}"#) else {
            panic!("the bundled robot");
        };
        let labels: Option<LabelsFile> = serde_json::from_str(text).ok();
        let all = [recording("a", Some("lnik4")), recording("b", None)];
        let notes = doubts(labels.as_ref(), &all, &cell);
        assert_eq!(notes[0], "labelled, but not in the set: typo");
        assert_eq!(notes[1], "without labels, and not scored: b");
        assert!(
            notes[2].contains("`lnik4` in 1 contact") && notes[2].contains("did you mean `link4`?"),
            "{notes:?}"
        );
        let good = [recording("a", Some("link4"))];
        assert_eq!(doubts(labels.as_ref(), &good, &cell).len(), 1);
    }
}
