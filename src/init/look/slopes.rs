//! What the slopes of measured over expected effort tell of the joints' signs.

use std::path::Path;

use tauscope_dynamics::effort_scale::{Slope, TELLING};
use tauscope_pipeline::report::Problem;
use tauscope_twin::TwinFile;

/// The slopes of the joints that tell one.
#[derive(Debug)]
pub(super) struct Slopes {
    /// Over all recordings.
    pub all: Vec<Slope>,
    /// What is odd in the recordings, a line each.
    pub notes: Vec<String>,
}

/// The joints whose line explains most of the measured effort.
pub(super) fn telling(file: &TwinFile) -> Vec<Slope> {
    let joints = file.joints.iter();
    let telling = joints.filter(|(_, joint)| joint.explained.unwrap_or(0.0) >= TELLING);
    let slopes = telling.map(|(name, joint)| Slope {
        joint: name.clone(),
        slope: joint.gain,
    });
    slopes.collect()
}

/// A joint whose effort has one sign in some recordings and the other in others. `each` is by recording.
pub(super) fn turned_in_some(each: &[(&Path, Vec<Slope>)]) -> Option<Problem> {
    let slopes_of = |joint: &str| -> Vec<(&Path, f64)> {
        let slopes = each.iter().flat_map(|(path, slopes)| {
            let of_it = slopes.iter().filter(|slope| slope.joint == joint);
            of_it.map(|slope| (*path, slope.slope))
        });
        slopes.collect()
    };
    let joints = each.iter().flat_map(|(_, slopes)| slopes);
    for Slope { joint, .. } in joints {
        let (turned, straight): (Vec<_>, Vec<_>) = slopes_of(joint)
            .into_iter()
            .partition(|(_, slope)| *slope < 0.0);
        if turned.is_empty() || straight.is_empty() {
            continue;
        }
        let paths = turned.iter().map(|(path, _)| path.display().to_string());
        let title = format!(
            "the effort of {joint} has the other sign than this robot's motion requires in {}, and not in the others",
            paths.collect::<Vec<_>>().join(", ")
        );
        let help = "the driver was changed in between: leave these recordings out, or those before";
        return Some(Problem::new(title).help(help));
    }
    None
}

/// Which joints' signs were found right.
pub(super) fn signs(slopes: &[Slope]) -> Option<String> {
    let names: Vec<&str> = slopes.iter().map(|slope| slope.joint.as_str()).collect();
    (!names.is_empty()).then(|| {
        format!(
            "The signs of {} are those of the URDF; other joints bear too little weight to tell theirs.",
            names.join(", ")
        )
    })
}
