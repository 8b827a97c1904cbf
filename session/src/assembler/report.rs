//! Findings about what an assembler took, and why nothing could be assembled.

use super::Assembler;
use crate::error::Unusable;
use crate::finding::Finding;
use crate::publisher::Publisher;

impl Assembler {
    /// Findings about the messages so far.
    pub fn findings(&self) -> Vec<Finding> {
        let mut all = Vec::new();
        all.extend(self.publishers_finding());
        all.extend(self.selection.of_clock.clone());
        all.extend(self.selection.of_velocity.clone());
        if !self.undecodable.is_empty() {
            all.push(Finding::Undecodable {
                reasons: self.undecodable.clone(),
            });
        }
        let counts = self.counts();
        all.extend(self.twice().map(Finding::NamedTwice));
        all.extend(
            self.gather
                .not_finite()
                .map(|(joint, values)| Finding::NotFinite {
                    joint: self.selection.joint_names[joint].clone(),
                    values,
                }),
        );
        all.extend(self.value_findings());
        let seconds = |ns: i64| ns as f64 * 1e-9;
        if counts.resets > 0 {
            let jumps = self.jumps.iter();
            all.push(Finding::JumpsBack {
                jumps: jumps.map(|&(at, by)| (seconds(at), seconds(by))).collect(),
                count: counts.resets,
                refused: counts.behind,
            });
        }
        let counted = [
            (
                counts.late,
                Finding::LateMessages {
                    messages: counts.late,
                },
            ),
            (
                counts.stalled,
                Finding::StalledStamps {
                    messages: counts.stalled,
                },
            ),
            (
                counts.incomplete,
                Finding::NoPositions {
                    messages: counts.incomplete,
                },
            ),
            (
                counts.copies,
                Finding::Copies {
                    messages: counts.copies,
                },
            ),
            (
                counts.parted,
                Finding::MissingParts {
                    messages: counts.parted,
                },
            ),
        ];
        all.extend(
            counted
                .into_iter()
                .filter(|(count, _)| *count > 0)
                .map(|(_, it)| it),
        );
        all
    }

    fn value_findings(&self) -> Vec<Finding> {
        let (first_ns, _) = self.first_ns.unwrap_or_default();
        let mut all = Vec::new();
        for (joint, name) in self.selection.joint_names.iter().enumerate() {
            for (field, field_name) in tauscope_archive::FIELDS.into_iter().enumerate() {
                let refused = &self.impossible[joint][field];
                if refused.messages > 0 {
                    all.push(Finding::Impossible {
                        joint: name.clone(),
                        field: field_name,
                        example: refused.example,
                        subnormal: refused.subnormal,
                        times: refused.times(first_ns),
                        of_messages: self.messages,
                        usual: self.selection.ranges.usual(joint, field),
                    });
                }
            }
            let dropouts = &self.dropouts[joint];
            if dropouts.messages > 0 {
                all.push(Finding::Dropouts {
                    joint: name.clone(),
                    times: dropouts.times(first_ns),
                });
            }
        }
        all
    }

    /// Which publishers are used, where there are several.
    fn publishers_finding(&self) -> Option<Finding> {
        let all = self.selection.publishers.listed();
        let of = |is_used: bool| -> Vec<Publisher> {
            let these = all
                .iter()
                .filter(|(place, _)| self.selection.used[*place] == is_used);
            these.map(|(_, publisher)| publisher.clone()).collect()
        };
        (all.len() > 1).then(|| Finding::Publishers {
            topic: self.selection.topic.clone(),
            used: of(true),
            ignored: of(false),
        })
    }

    /// Reports, after the last message, why there was no state.
    pub fn unusable(&self) -> Unusable {
        let messages = self.messages;
        if let Some((joint, field)) = self.never_finite() {
            return Unusable::NotFiniteThroughout {
                joint,
                field,
                messages,
            };
        }
        if let Some(twice) = self.twice() {
            return Unusable::NamedTwice(twice);
        }
        let missing = self.layouts.never_named();
        if messages > 0 && !missing.is_empty() {
            let all = self.selection.publishers.all.clone();
            return Unusable::JointsMissing { missing, all };
        }
        if messages > 0 && self.counts.incomplete == messages {
            return Unusable::NoPositions { messages };
        }
        let finding = self.findings().into_iter();
        let worst = finding.max_by_key(Finding::effect);
        match worst {
            Some(worst) => Unusable::Finding {
                topic: self.selection.topic.clone(),
                finding: Box::new(worst),
            },
            None => Unusable::NoSample { messages },
        }
    }
}
