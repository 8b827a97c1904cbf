//! The arm as a tree of links and joints.

use std::collections::BTreeSet;

use tauscope_dynamics::Model;

/// The joints that carry a link.
pub fn bearing(model: &Model, link: usize) -> BTreeSet<usize> {
    let links = std::iter::successors(Some(link), |&link| model.links()[link].parent);
    links.filter_map(|link| model.links()[link].joint).collect()
}
