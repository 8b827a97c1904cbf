//! Findings grouped by joint or link, the group with the largest effort first.

use super::effects::place;
use tauscope_explain::report::{Finding, Report};

/// The findings of a place.
pub(super) struct Group<'a> {
    /// Joint of the findings, if they have one.
    pub joint: Option<&'a str>,
    /// Link of the findings, if they have one and no joint.
    pub link: Option<&'a str>,
    /// Findings, the largest effort first.
    pub findings: Vec<&'a Finding>,
    /// Effort of the largest finding \[effort unit\].
    pub effort: f64,
}

impl Group<'_> {
    /// Name of the place.
    pub fn title(&self) -> String {
        place(self.joint, self.link).unwrap_or_else(|| "Whole arm".to_owned())
    }

    /// Whether the group belongs to this joint.
    pub fn is_joint(&self, joint: &str) -> bool {
        self.joint == Some(joint)
    }
}

/// The findings by place, the largest effort first, among places and within each.
pub fn largest_first(report: &Report) -> impl Iterator<Item = &Finding> {
    of(report).into_iter().flat_map(|group| group.findings)
}

/// Groups the findings by place, and sorts groups and findings by effort.
pub(super) fn of(report: &Report) -> Vec<Group<'_>> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    for finding in &report.findings {
        let (joint, link) = (finding.joint.as_deref(), finding.link.as_deref());
        // An `unknown` body has joint and link; it is listed with its joint.
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
