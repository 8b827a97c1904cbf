//! Findings by the joint or link that they are in, that with the largest effort first.

use super::effects::place;
use tauscope_explain::report::{Finding, Report};

/// The findings of a place.
pub(super) struct Group<'a> {
    /// The joint, if they are in one.
    pub joint: Option<&'a str>,
    /// The link, if they are in one.
    pub link: Option<&'a str>,
    /// The largest first.
    pub findings: Vec<&'a Finding>,
    /// Of the largest \[effort unit\].
    pub effort: f64,
}

impl Group<'_> {
    /// What the place is called.
    pub fn title(&self) -> String {
        place(self.joint, self.link).unwrap_or_else(|| "Whole arm".to_owned())
    }

    /// Whether it is this joint.
    pub fn is_joint(&self, joint: &str) -> bool {
        self.joint == Some(joint)
    }
}

/// The findings, those of the place with the largest effort first, and in a place the largest first.
pub fn largest_first(report: &Report) -> impl Iterator<Item = &Finding> {
    of(report).into_iter().flat_map(|group| group.findings)
}

/// The findings by place; places and what is in them by effort.
pub(super) fn of(report: &Report) -> Vec<Group<'_>> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    for finding in &report.findings {
        let (joint, link) = (finding.joint.as_deref(), finding.link.as_deref());
        // An unnamed body is told with the joint that carries it.
        let link = link.filter(|_| joint.is_none());
        let known = groups
            .iter_mut()
            .find(|g| (g.joint, g.link) == (joint, link));
        match known {
            Some(group) => group.findings.push(finding),
            None => groups.push(Group {
                joint,
                link,
                findings: vec![finding],
                effort: 0.0,
            }),
        }
    }
    for group in &mut groups {
        group
            .findings
            .sort_by(|a, b| b.effort_rms.total_cmp(&a.effort_rms));
        group.effort = group.findings.first().map_or(0.0, |first| first.effort_rms);
    }
    groups.sort_by(|a, b| b.effort.total_cmp(&a.effort));
    groups
}
