//! Summary of a contact, from its first sample to its last.
//!
//! At the onset the force has hardly built up, and the link is uncertain. Terminal, archive, picture and replay all
//! report this summary, so that they agree.

use std::fmt;

use crate::sample::{Detection, EventKind, Name, flags};

/// A contact, or a change of the arm, as a detector reports it.
///
/// Link and joints are the newest estimate, because a detector estimates them from the whole contact so far. The kind
/// is that of the sample with the largest score. The force is that of the sample with the largest score among those
/// that name the link: the largest of many force estimates would be biased high.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Kind: the detector's state, e.g. `contact`, `collision`.
    pub kind: Name,
    /// The touched link; empty where not estimated.
    pub link: Name,
    /// A second link that fits nearly as well; empty where the first is unambiguous.
    pub other_link: Name,
    /// Joints that carry torque from the contact: bit j for joint j.
    pub joints: u32,
    /// Estimated start \[ns since the epoch\].
    pub contact_ns: i64,
    /// Stamp of the sample that raised the alarm \[ns since the epoch\].
    pub onset_ns: i64,
    /// Stamp of the sample that ended the contact, or of the newest while it lasts \[ns since the epoch\].
    pub end_ns: i64,
    /// Stamp of the newest sample whose score reached the threshold, if any \[ns since the epoch\].
    last_high_ns: Option<i64>,
    /// Largest score.
    pub peak_score: f64,
    /// Largest score of the samples that name the link.
    link_score: f64,
    /// Size of a change of the arm ([`flags::CHANGE`]), as reported at its onset.
    pub size: Option<f64>,
    /// Force at the sample with `link_score`, if estimated.
    force: Option<Force>,
}

/// A force on the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Force {
    /// Force vector, world frame \[N\].
    pub force_n: [f64; 3],
    /// Assumed point of application, world frame \[m\].
    pub point_m: [f64; 3],
}

impl Force {
    /// Magnitude \[N\].
    pub fn norm_n(&self) -> f64 {
        self.force_n.iter().map(|f| f * f).sum::<f64>().sqrt()
    }

    /// Unit vector of the force, world frame; zero for a zero force.
    pub fn direction(&self) -> [f64; 3] {
        let norm_n = self.norm_n();
        self.force_n
            .map(|f| if norm_n > 0.0 { f / norm_n } else { 0.0 })
    }
}

impl Contact {
    fn begins(detection: &Detection) -> Self {
        let mut contact = Self {
            kind: detection.state,
            link: detection.link,
            other_link: detection.other_link,
            joints: 0,
            contact_ns: detection.contact_ns,
            onset_ns: detection.header.stamp_ns,
            end_ns: detection.header.stamp_ns,
            last_high_ns: None,
            peak_score: f64::NEG_INFINITY,
            link_score: f64::NEG_INFINITY,
            size: detection
                .header
                .has(flags::CHANGE)
                .then_some(detection.size),
            force: None,
        };
        contact.goes_on(detection);
        contact
    }

    fn goes_on(&mut self, detection: &Detection) {
        self.end_ns = detection.header.stamp_ns;
        if detection.score >= detection.threshold {
            self.last_high_ns = Some(self.end_ns);
        }
        if detection.joints != 0 {
            self.joints = detection.joints;
        }
        if !detection.link.as_str().is_empty() {
            if self.link != detection.link {
                self.link_score = f64::NEG_INFINITY;
            }
            (self.link, self.other_link) = (detection.link, detection.other_link);
        }
        if detection.score >= self.peak_score {
            self.peak_score = detection.score;
            self.kind = detection.state;
        }
        if detection.score < self.link_score {
            return;
        }
        self.link_score = detection.score;
        if detection.header.has(flags::FORCE) {
            self.force = Some(Force {
                force_n: detection.force_n,
                point_m: detection.point_m,
            });
        }
    }

    /// The force at the largest score, if one was estimated.
    pub fn peak(&self) -> Option<&Force> {
        self.force.as_ref()
    }

    /// Duration from the sample that raised the alarm to the last one whose score reached the threshold \[s\]. Both
    /// have about the same delay; the estimated start is less exact, and the alarm is held beyond the contact.
    pub fn duration_s(&self) -> f64 {
        let last_ns = self.last_high_ns.unwrap_or(self.end_ns);
        last_ns.saturating_sub(self.onset_ns).max(0) as f64 * 1e-9
    }
}

impl Contact {
    /// Duration in words: `0.84 s`, or `one sample` if the score reached the threshold only once.
    pub fn duration_in_words(&self) -> String {
        match self.duration_s() {
            0.0 => "one sample".to_owned(),
            short if short < 0.01 => format!("{short:.3} s"),
            usual => format!("{usual:.2} s"),
        }
    }
}

/// Force and place in the wording of every output: `24 N at link5`, `24 N at link3 or link4`.
impl fmt::Display for Contact {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.peak(), self.link.as_str()) {
            (Some(peak), "") => write!(f, "{:.0} N", peak.norm_n()),
            (Some(peak), _) => write!(f, "{:.0} N at {}", peak.norm_n(), self.links()),
            (None, "") => f.write_str("place unknown"),
            (None, _) => write!(f, "at {}", self.links()),
        }
    }
}

/// One link, or two candidates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Links {
    link: Name,
    other_link: Name,
}

/// `link3` or `link3 or link4`.
impl fmt::Display for Links {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.other_link.as_str() {
            "" => f.write_str(self.link.as_str()),
            other => write!(f, "{} or {other}", self.link.as_str()),
        }
    }
}

impl Contact {
    /// The candidate links, in words.
    pub fn links(&self) -> Links {
        let (link, other_link) = (self.link, self.other_link);
        Links { link, other_link }
    }
}

impl Detection {
    /// The candidate links of the contact, in words; empty where not estimated.
    pub fn links(&self) -> Links {
        let (link, other_link) = (self.link, self.other_link);
        Links { link, other_link }
    }
}

/// Tracks a detector's contacts. Holds one contact and does not allocate.
#[derive(Debug, Clone, Default)]
pub struct ContactFollower {
    open: Option<Contact>,
}

impl ContactFollower {
    /// Processes the next sample. Returns the contact that ends with it, at its offset or at the onset of the next
    /// contact.
    pub fn push(&mut self, detection: &Detection) -> Option<Contact> {
        let stamp_ns = detection.header.stamp_ns;
        let end = |mut contact: Contact| {
            contact.end_ns = stamp_ns;
            contact
        };
        match (detection.event(), &mut self.open) {
            (EventKind::Onset, open) => open.replace(Contact::begins(detection)).map(end),
            (EventKind::Offset, open) => open.take().map(end),
            (EventKind::None, Some(contact)) => {
                contact.goes_on(detection);
                None
            }
            (EventKind::None, None) => None,
        }
    }

    /// The contact in progress, as estimated so far.
    pub fn open(&self) -> Option<&Contact> {
        self.open.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(t: i64, event: u32, score: f64, link: &str, newton: f64) -> Detection {
        let mut detection = Detection {
            state: "contact".into(),
            link: link.into(),
            score,
            event,
            contact_ns: 5,
            joints: 1 << (t % 3),
            force_n: [0.0, newton, 0.0],
            ..Detection::default()
        };
        detection.header.stamp_ns = t;
        detection.header.flags = flags::ALARM | flags::FORCE;
        detection
    }

    #[test]
    fn the_end_tells_link_and_force_at_the_peak_of_the_contact_not_the_onsets_guess() {
        let mut contacts = ContactFollower::default();
        assert!(contacts.push(&Detection::default()).is_none());
        contacts.push(&sample(10, Detection::ONSET, 9.0, "link2", 4.0));
        assert_eq!(contacts.open().unwrap().to_string(), "4 N at link2");
        // An outlier at another link must not become the peak.
        contacts.push(&sample(20, 0, 20.0, "link1", 300.0));
        contacts.push(&sample(30, 0, 80.0, "link5", 24.0));
        contacts.push(&sample(40, 0, 70.0, "link5", 25.0));
        // The arm rebounds.
        contacts.push(&sample(45, 0, 12.0, "link5", -60.0));
        let end = sample(50, Detection::OFFSET, 1.0, "", 0.0);
        let ended = contacts.push(&end).unwrap();
        assert_eq!(ended.to_string(), "24 N at link5");
        assert!((ended.peak().unwrap().direction()[1] - 1.0).abs() < 1e-12);
        assert_eq!(
            (ended.contact_ns, ended.onset_ns, ended.end_ns),
            (5, 10, 50)
        );
        // The alarm was held until 50.
        assert!((ended.duration_s() - 35e-9).abs() < 1e-15);
        assert!(contacts.open().is_none());
        assert!(contacts.push(&end).is_none());
    }

    #[test]
    fn two_links_are_told_where_the_peak_of_the_contact_does_not_part_them() {
        let mut contacts = ContactFollower::default();
        contacts.push(&sample(10, Detection::ONSET, 9.0, "link2", 4.0));
        let mut unsure = sample(20, 0, 80.0, "link3", 24.0);
        unsure.other_link = "link4".into();
        contacts.push(&unsure);
        let words = |contacts: &ContactFollower| contacts.open().unwrap().to_string();
        assert_eq!(words(&contacts), "24 N at link3 or link4");
        assert_eq!(unsure.links().to_string(), "link3 or link4");
        // Later the link is unambiguous and the force larger.
        contacts.push(&sample(30, 0, 90.0, "link3", 25.0));
        assert_eq!(words(&contacts), "25 N at link3");
    }

    #[test]
    fn link_and_joints_are_those_of_the_whole_contact_and_the_force_is_of_that_link() {
        let mut contacts = ContactFollower::default();
        contacts.push(&sample(10, Detection::ONSET, 9.0, "hand", 4.0));
        contacts.push(&sample(20, 0, 80.0, "hand", 40.0));
        contacts.push(&sample(30, 0, 60.0, "fore", 22.0));
        contacts.push(&sample(40, 0, 70.0, "fore", 24.0));
        contacts.push(&sample(50, 0, 50.0, "fore", 21.0));
        let contact = contacts.open().unwrap();
        assert_eq!(contact.to_string(), "24 N at fore");
        assert_eq!(contact.joints, 1 << (50 % 3));
        assert!((contact.peak_score - 80.0).abs() < 1e-12);
    }

    #[test]
    fn a_contact_of_one_sample_is_not_said_to_last_no_time() {
        let ended = |last_high: i64| {
            let mut contacts = ContactFollower::default();
            contacts.push(&sample(10, Detection::ONSET, 9.0, "link2", 4.0));
            let mut low = sample(last_high, 0, 9.0, "link2", 4.0);
            low.threshold = 5.0;
            contacts.push(&low);
            contacts.push(&sample(2_000_000_000, Detection::OFFSET, 1.0, "", 0.0))
        };
        let words = |last_high| ended(last_high).map(|it| it.duration_in_words());
        assert_eq!(words(10).as_deref(), Some("one sample"));
        assert_eq!(words(4_000_010).as_deref(), Some("0.004 s"));
        assert_eq!(words(840_000_010).as_deref(), Some("0.84 s"));
    }

    #[test]
    fn a_contact_ends_where_the_next_one_begins() {
        let mut contacts = ContactFollower::default();
        contacts.push(&sample(10, Detection::ONSET, 9.0, "link2", 4.0));
        let next = sample(20, Detection::ONSET, 9.0, "link3", 6.0);
        let ended = contacts.push(&next).unwrap();
        assert_eq!(
            (ended.end_ns, ended.to_string().as_str()),
            (20, "4 N at link2")
        );
        assert_eq!(contacts.open().unwrap().to_string(), "6 N at link3");
    }

    #[test]
    fn a_detector_that_tells_no_place_has_contacts_too() {
        let mut contacts = ContactFollower::default();
        let mut onset = sample(10, Detection::ONSET, 9.0, "", 0.0);
        onset.header.flags = flags::ALARM;
        contacts.push(&onset);
        let contact = contacts.open().unwrap();
        assert!(contact.peak().is_none());
        assert_eq!(contact.to_string(), "place unknown");
    }
}
