//! Assignment of the elements of features to joints and quantities.

use std::path::Path;

use super::columns::ColumnsFile;
use super::info::{Feature, Info};
use super::names::{self, Kind};
use crate::csv_file::Columns;
use crate::lerobot_error::{LerobotError, LerobotProblem};

/// An element of a feature.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Element {
    /// Index into [`Layout::features`].
    pub(super) feature: usize,
    /// Index in the feature.
    pub(super) at: usize,
}

/// The element of a quantity for each joint; `None` for a joint without the quantity. Empty if no joint has it.
pub(super) type Quantity = Vec<Option<Element>>;

/// Joint data in the rows of a data set.
#[derive(Debug, Default)]
pub(super) struct Layout {
    /// The robot's joints.
    pub(super) joints: Vec<String>,
    /// The features that are read: columns of the table.
    pub(super) features: Vec<String>,
    pub(super) position: Quantity,
    pub(super) velocity: Quantity,
    pub(super) effort: Quantity,
    /// Factor applied to positions and velocities: degrees to radians, or 1.
    pub(super) scale: f64,
    /// All numeric features, for error messages.
    pub(super) known: Vec<String>,
}

/// An element, with the joint and the quantity in its name.
struct Named {
    joint: String,
    kind: Option<Kind>,
    element: Element,
}

impl Layout {
    /// Determines the layout of the data set in the folder `root`.
    pub(super) fn of(
        root: &Path,
        info: &Info,
        columns: &ColumnsFile,
    ) -> Result<Self, LerobotError> {
        let numeric = info
            .features
            .iter()
            .filter(|(_, feature)| feature.is_numeric());
        let known = numeric.map(|(name, _)| name.clone()).collect();
        let mut builder = Builder {
            info,
            layout: Self {
                scale: if columns.degrees == Some(true) {
                    std::f64::consts::PI / 180.0
                } else {
                    1.0
                },
                known,
                ..Self::default()
            },
        };
        let columns_file = ColumnsFile::path(root);
        match builder.build(columns) {
            Ok(()) if builder.layout.position.is_empty() => {
                let features = builder.layout.known;
                let problem = LerobotProblem::NoPosition {
                    features,
                    columns_file,
                };
                Err(LerobotError::new(root, problem))
            }
            Ok(()) => Ok(builder.layout),
            Err((what, reason)) => {
                let problem = LerobotProblem::Columns { what, reason };
                Err(LerobotError::new(&columns_file, problem))
            }
        }
    }
}

/// A key of the columns file, and the reason why it does not fit.
type Unfit = (&'static str, String);

struct Builder<'a> {
    info: &'a Info,
    layout: Layout,
}

impl Builder<'_> {
    fn build(&mut self, columns: &ColumnsFile) -> Result<(), Unfit> {
        let state = self.first_of(&names::STATE);
        let of_state = |kind: Kind| {
            let of_kind = state.iter().filter(move |named| named.kind == Some(kind));
            of_kind.map(|named| (named.joint.as_str(), named.element))
        };
        // In a state feature, an element without a suffix is a position.
        let is_position = |named: &&Named| matches!(named.kind, None | Some(Kind::Position));
        let positions = state.iter().filter(is_position);
        let mut positions: Vec<(String, Element)> = positions
            .map(|named| (named.joint.clone(), named.element))
            .collect();
        if let Some(own) = &columns.position {
            positions = self.named("position", own)?;
        }
        let joints: Vec<String> = positions.iter().map(|(joint, _)| joint.clone()).collect();
        let by_joint = |found: Vec<(&str, Element)>| -> Quantity {
            let of = |joint: &String| found.iter().find(|(name, _)| name == joint);
            let all: Quantity = joints
                .iter()
                .map(|joint| of(joint).map(|(_, e)| *e))
                .collect();
            if all.iter().any(Option::is_some) {
                all
            } else if found.len() == joints.len() {
                // Names without a known joint, such as `effort_0`, are assigned in order.
                found.iter().map(|(_, element)| Some(*element)).collect()
            } else {
                Vec::new()
            }
        };
        let mut quantities = [Vec::new(), Vec::new()];
        let kinds = [
            (
                "velocity",
                Kind::Velocity,
                &names::VELOCITY,
                &columns.velocity,
            ),
            ("effort", Kind::Effort, &names::EFFORT, &columns.effort),
        ];
        for (quantity, (what, kind, features, own)) in quantities.iter_mut().zip(kinds) {
            if let Some(own) = own {
                let found = self.named(what, own)?;
                check_count(what, found.len(), joints.len())?;
                *quantity = found.iter().map(|(_, element)| Some(*element)).collect();
                continue;
            }
            *quantity = by_joint(of_state(kind).collect());
            if quantity.is_empty() {
                let feature = self.first_of(features);
                let is_own = |named: &&Named| named.kind.is_none() || named.kind == Some(kind);
                let found = feature.iter().filter(is_own);
                let found = found.map(|named| (named.joint.as_str(), named.element));
                *quantity = by_joint(found.collect());
            }
        }
        [self.layout.velocity, self.layout.effort] = quantities;
        self.layout.position = positions
            .iter()
            .map(|(_, element)| Some(*element))
            .collect();
        self.layout.joints = joints;
        if let Some(own) = &columns.joints {
            check_count("joints", own.len(), self.layout.joints.len()).map_err(
                |(what, reason)| {
                    let names = self.layout.joints.join(", ");
                    (what, format!("{reason}, which the data set calls {names}"))
                },
            )?;
            self.layout.joints.clone_from(own);
        }
        Ok(())
    }

    /// Returns the elements of the first of these features that exists.
    fn first_of(&mut self, features: &[&str]) -> Vec<Named> {
        let is_there = |name: &&&str| {
            self.info
                .features
                .get(**name)
                .is_some_and(Feature::is_numeric)
        };
        match features.iter().find(is_there) {
            Some(feature) => self.elements(feature),
            None => Vec::new(),
        }
    }

    /// Returns the elements of a feature. Elements without names are called `joint_0`, `joint_1` and so on.
    fn elements(&mut self, feature: &str) -> Vec<Named> {
        let Some(about) = self.info.features.get(feature) else {
            return Vec::new();
        };
        let place = self.place(feature);
        let names = about.names();
        (0..about.width().unwrap_or(0).min(super::MOST_ELEMENTS))
            .map(|at| {
                let numbered = format!("joint_{at}");
                let name = names.as_ref().map_or(numbered.as_str(), |names| names[at]);
                let (joint, kind) = names::split(name);
                Named {
                    joint: joint.to_owned(),
                    kind,
                    element: Element { feature: place, at },
                }
            })
            .collect()
    }

    /// Returns the index of a feature among those that are read, and adds it if necessary.
    fn place(&mut self, feature: &str) -> usize {
        let features = &mut self.layout.features;
        let found = features.iter().position(|own| own == feature);
        found.unwrap_or_else(|| {
            features.push(feature.to_owned());
            features.len() - 1
        })
    }

    /// Returns the elements that the columns file names: `FEATURE` for all of a feature, `FEATURE.NAME` for one.
    fn named(
        &mut self,
        what: &'static str,
        columns: &Columns,
    ) -> Result<Vec<(String, Element)>, Unfit> {
        let (None, None, Some(wanted)) = (&columns.first, &columns.numbers, &columns.names) else {
            let reason = "a data set's columns have names: give `names`, one for each joint, or a feature for all";
            return Err((what, reason.to_owned()));
        };
        let mut found = Vec::new();
        for name in wanted {
            let before = found.len();
            let features = self.layout.known.clone();
            for feature in features {
                if *name == feature {
                    let all = self.elements(&feature).into_iter();
                    found.extend(all.map(|named| (named.joint, named.element)));
                } else if let Some(own) = name
                    .strip_prefix(&feature)
                    .and_then(|own| own.strip_prefix('.'))
                {
                    let names = self.info.features[&feature].names().unwrap_or_default();
                    if let Some(at) = names.iter().position(|name| *name == own) {
                        let (joint, _) = names::split(own);
                        let place = self.place(&feature);
                        found.push((joint.to_owned(), Element { feature: place, at }));
                    }
                }
            }
            if found.len() == before {
                let known = self.layout.known.join(", ");
                let reason = format!(
                    "no feature {name:?}, and no element of one; the features are {known}, and an element is FEATURE.NAME"
                );
                return Err((what, reason));
            }
        }
        Ok(found)
    }
}

fn check_count(what: &'static str, found: usize, joints: usize) -> Result<(), Unfit> {
    if found == joints {
        return Ok(());
    }
    Err((what, format!("{found} for {joints} joints")))
}
