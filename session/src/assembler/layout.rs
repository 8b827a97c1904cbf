//! Positions of a message's joints in the cell's order.

/// Largest number of cached layouts; a topic with more publishers is searched each time.
/// Resolution: memory against search time.
const MAX_KNOWN: usize = 16;

/// The order of one publisher's joints.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Layout {
    names: Vec<String>,
    /// Index in the cell's order of each entry, if it is one of the cell's joints.
    pub places: Vec<Option<usize>>,
    /// Bit j: the message has joint j.
    pub joints: u32,
    /// A joint of the cell that the message names more than once, with its first and second index.
    pub twice: Option<(usize, [usize; 2])>,
}

/// The layouts of all publishers so far.
#[derive(Debug)]
pub struct Layouts {
    joint_names: Vec<String>,
    known: Vec<Layout>,
    newest: usize,
    named: u32,
}

impl Layouts {
    /// Creates the layouts of a robot with these joints.
    pub fn new(joint_names: &[String]) -> Self {
        Self {
            joint_names: joint_names.to_vec(),
            known: Vec::new(),
            newest: 0,
            named: 0,
        }
    }

    /// Returns the layout of a message that names these joints. The lookup compares names without allocation, because
    /// one publisher sends the same names each time.
    pub fn of(&mut self, names: &[String]) -> &Layout {
        let known = if self
            .known
            .get(self.newest)
            .is_some_and(|l| l.names == names)
        {
            Some(self.newest)
        } else {
            self.known.iter().position(|layout| layout.names == names)
        };
        self.newest = match known {
            Some(index) => index,
            None => self.learn(names),
        };
        &self.known[self.newest]
    }

    fn learn(&mut self, names: &[String]) -> usize {
        let places: Vec<_> = names
            .iter()
            .map(|name| self.joint_names.iter().position(|joint| joint == name))
            .collect();
        let joints = places.iter().flatten().fold(0, |mask, &j| mask | (1 << j));
        self.named |= joints;
        let twice = first_twice(&places);
        if self.known.len() == MAX_KNOWN {
            self.known.pop();
        }
        self.known.push(Layout {
            names: names.to_vec(),
            places,
            joints,
            twice,
        });
        self.known.len() - 1
    }

    /// Returns the name of a joint of the robot.
    pub fn joint_name(&self, joint: usize) -> &str {
        &self.joint_names[joint]
    }

    /// Returns the joints of the cell that no message named.
    pub fn never_named(&self) -> Vec<String> {
        self.joint_names
            .iter()
            .enumerate()
            .filter(|(j, _)| self.named & (1 << j) == 0)
            .map(|(_, name)| name.clone())
            .collect()
    }
}

/// Returns the first joint of the cell that is named more than once, with its first two indices.
fn first_twice(places: &[Option<usize>]) -> Option<(usize, [usize; 2])> {
    let mut named = places.iter().enumerate();
    named.find_map(|(second, place)| {
        let joint = (*place)?;
        let first = places.iter().position(|other| *other == Some(joint))?;
        (first < second).then_some((joint, [first, second]))
    })
}
