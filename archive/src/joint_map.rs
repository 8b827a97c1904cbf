//! Joints by name.

/// How many layouts of messages are remembered; more publishers than that on one topic cost time,
/// nothing else.
const REMEMBERED: usize = 16;

/// Why a message cannot be laid out as wanted.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JointMapError {
    /// It has some of the wanted joints, but not all.
    #[error(
        "joints {} are missing: the message has {}, wanted are {}",
        missing.join(", "), known.join(", "), wanted.join(", ")
    )]
    Missing {
        /// Wanted, but not there.
        missing: Vec<String>,
        /// What the message has.
        known: Vec<String>,
        /// What is wanted.
        wanted: Vec<String>,
    },
    /// A joint stands in it twice.
    #[error("joint {joint} stands twice in a message with {}", known.join(", "))]
    Twice {
        /// The joint.
        joint: String,
        /// What the message has.
        known: Vec<String>,
    },
}

/// Finds wanted joints in messages that may name them in any order, among others, and may come from
/// several publishers that do not agree.
#[derive(Debug, Clone)]
pub struct JointMap {
    wanted: Vec<String>,
    remembered: Vec<(Vec<String>, Option<Vec<usize>>)>,
    /// The names of the first message that had none of the wanted joints.
    first_of_others: Option<Vec<String>>,
    matched: bool,
}

impl JointMap {
    /// A map to these joints, in this order.
    pub fn new(wanted: &[String]) -> Self {
        Self {
            wanted: wanted.to_vec(),
            remembered: Vec::new(),
            first_of_others: None,
            matched: false,
        }
    }

    /// The joints it maps to.
    pub fn wanted(&self) -> &[String] {
        &self.wanted
    }

    /// For each wanted joint, its place in a message with these `names`; `None` if the message is
    /// about other joints altogether (a gripper's driver, say).
    ///
    /// Costs one comparison of the names where they are as in an earlier message, and allocates
    /// nothing then.
    ///
    /// # Errors
    /// [`JointMapError`] if only some of the wanted joints are there, or one stands there twice.
    pub fn find(&mut self, names: &[String]) -> Result<Option<&[usize]>, JointMapError> {
        let known = self
            .remembered
            .iter()
            .position(|(remembered, _)| remembered == names);
        let index = match known {
            Some(index) => index,
            None => self.learn(names)?,
        };
        Ok(self.remembered[index].1.as_deref())
    }

    /// What to say of a stream that has ended (or goes on and on) without one message about the
    /// wanted joints; `None` if there was one, or no message at all.
    pub fn never_found(&self) -> Option<JointMapError> {
        let known = self.first_of_others.as_ref().filter(|_| !self.matched)?;
        Some(JointMapError::Missing {
            missing: self.wanted.clone(),
            known: known.clone(),
            wanted: self.wanted.clone(),
        })
    }

    fn learn(&mut self, names: &[String]) -> Result<usize, JointMapError> {
        let mut places = Vec::with_capacity(self.wanted.len());
        let mut missing = Vec::new();
        for joint in &self.wanted {
            let mut found = (0..names.len()).filter(|&i| names[i] == *joint);
            match (found.next(), found.next()) {
                (Some(place), None) => places.push(place),
                (Some(_), Some(_)) => {
                    return Err(JointMapError::Twice {
                        joint: joint.clone(),
                        known: names.to_vec(),
                    });
                }
                (None, _) => missing.push(joint.clone()),
            }
        }
        let places = if missing.is_empty() {
            self.matched = true;
            Some(places)
        } else if places.is_empty() {
            self.first_of_others.get_or_insert_with(|| names.to_vec());
            None
        } else {
            return Err(JointMapError::Missing {
                missing,
                known: names.to_vec(),
                wanted: self.wanted.clone(),
            });
        };
        if self.remembered.len() == REMEMBERED {
            self.remembered.remove(0);
        }
        self.remembered.push((names.to_vec(), places));
        Ok(self.remembered.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<String> {
        text.split_whitespace().map(str::to_owned).collect()
    }

    #[test]
    fn joints_are_found_by_name_whoever_publishes() {
        let mut map = JointMap::new(&names("a b c"));
        for _ in 0..2 {
            assert_eq!(map.find(&names("c x a b")), Ok(Some([2, 3, 0].as_slice())));
            assert_eq!(map.find(&names("gripper")), Ok(None));
            assert_eq!(map.find(&names("a b c")), Ok(Some([0, 1, 2].as_slice())));
        }
        assert_eq!(map.never_found(), None);
    }

    #[test]
    fn some_of_the_joints_are_an_error_with_all_names() {
        let mut map = JointMap::new(&names("a b c"));
        let error = map.find(&names("b x")).unwrap_err();
        assert_eq!(
            error.to_string(),
            "joints a, c are missing: the message has b, x, wanted are a, b, c"
        );
        let error = map.find(&names("a b b c")).unwrap_err();
        assert_eq!(
            error.to_string(),
            "joint b stands twice in a message with a, b, b, c"
        );
    }

    #[test]
    fn a_stream_about_other_joints_is_told() {
        let mut map = JointMap::new(&names("a b"));
        assert_eq!(map.never_found(), None);
        assert_eq!(map.find(&names("x y")), Ok(None));
        assert!(map.never_found().unwrap().to_string().contains("x, y"));
    }

    #[test]
    fn more_layouts_than_are_remembered_still_work() {
        let mut map = JointMap::new(&names("a"));
        for i in 0..3 * REMEMBERED {
            let layout = [vec![format!("x{i}")], names("a")].concat();
            assert_eq!(map.find(&layout), Ok(Some([1].as_slice())));
        }
    }
}
