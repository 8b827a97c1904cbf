//! Pushes: temporary forces on links.

use std::f64::consts::PI;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, UnitSphere};
use tauscope_dynamics::Model;

use super::check;
use super::error::ScenarioError;
use super::plant::Contact;
use super::scenario::{ContactKind, HandsSpec, LabelSpec, Profile, RecordingSpec};

/// Largest distance of a random push from the link's centre of mass, along each axis \[m\].
/// Chosen: for simulated cells only; within the radius of a link.
const REACH_M: f64 = 0.03;

/// A force on a link that rises, holds and falls.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Push {
    /// Index of the link in the model.
    pub link: usize,
    /// Point of application in the link's frame \[m\].
    pub point_m: [f64; 3],
    /// Peak force on the robot, world frame \[N\].
    pub force_n: [f64; 3],
    pub on_s: f64,
    pub off_s: f64,
    pub rise_s: f64,
    pub profile: Profile,
    pub kind: ContactKind,
    pub label: LabelSpec,
}

impl Push {
    /// Returns the force at `t_s` as a fraction of its peak, 0 to 1.
    pub fn share(&self, t_s: f64) -> f64 {
        let rise_s = self.rise_s.min(0.5 * (self.off_s - self.on_s));
        let inside_s = (t_s - self.on_s).min(self.off_s - t_s);
        let u = (inside_s / rise_s).clamp(0.0, 1.0);
        match self.profile {
            Profile::Smooth => 0.5 - 0.5 * (PI * u).cos(),
            Profile::Trapezoid => u,
            Profile::HalfSine => {
                let share = (t_s - self.on_s) / (self.off_s - self.on_s);
                (PI * share.clamp(0.0, 1.0)).sin()
            }
        }
    }

    /// Returns its contact force at a fraction of the peak.
    pub fn contact(&self, share: f64) -> Contact {
        Contact {
            link: self.link,
            point_m: self.point_m,
            force_n: self.force_n.map(|f| share * f),
        }
    }

    /// Whether the force acts at `t_s`.
    pub fn acts(&self, t_s: f64) -> bool {
        self.on_s < t_s && t_s < self.off_s
    }

    /// Returns the time of its peak, halfway \[s\].
    pub fn peak_s(&self) -> f64 {
        0.5 * (self.on_s + self.off_s)
    }
}

/// Returns the pushes of a recording, ordered by their begin.
pub(super) fn pushes(
    spec: &RecordingSpec,
    model: &Model,
    rng: ChaCha8Rng,
) -> Result<Vec<Push>, ScenarioError> {
    let mut pushes = Vec::with_capacity(spec.contacts.len());
    for contact in &spec.contacts {
        if !(contact.t_on_s < contact.t_off_s && contact.t_off_s <= spec.duration_s) {
            return Err(ScenarioError::Range {
                what: "contacts",
                reason: format!(
                    "t_on_s {}, t_off_s {} is no time within the {} s of recording `{}`",
                    contact.t_on_s, contact.t_off_s, spec.duration_s, spec.name
                ),
            });
        }
        let link = moving_link(spec, model, "a contact", &contact.link)?;
        pushes.push(Push {
            link,
            point_m: contact
                .point_m
                .unwrap_or_else(|| model.links()[link].com_m()),
            force_n: contact.force_n,
            on_s: contact.t_on_s,
            off_s: contact.t_off_s,
            rise_s: contact.rise_s,
            profile: contact.profile,
            kind: contact.kind,
            label: contact.label.clone(),
        });
    }
    if let Some(hands) = &spec.hands {
        pushes.extend(draw(hands, spec, model, rng)?);
    }
    pushes.sort_by(|a, b| a.on_s.total_cmp(&b.on_s));
    Ok(pushes)
}

/// Draws one push in each of `count` equal parts of the recording.
fn draw(
    hands: &HandsSpec,
    spec: &RecordingSpec,
    model: &Model,
    mut rng: ChaCha8Rng,
) -> Result<Vec<Push>, ScenarioError> {
    check::order("hands.force_n", hands.force_n)?;
    check::order("hands.duration_s", hands.duration_s)?;
    let part_s = (spec.duration_s - hands.after_s) / f64::from(hands.count.max(1));
    if hands.count > 0 && part_s <= hands.duration_s[1] {
        return Err(ScenarioError::Range {
            what: "hands",
            reason: format!(
                "{} pushes of up to {} s do not fit into the {} s of recording `{}` after {} s",
                hands.count, hands.duration_s[1], spec.duration_s, spec.name, hands.after_s
            ),
        });
    }
    let links = if hands.links.is_empty() {
        model
            .joints()
            .iter()
            .map(|joint| joint.child_link)
            .collect()
    } else {
        let find = |name: &String| moving_link(spec, model, "a hand", name);
        hands
            .links
            .iter()
            .map(find)
            .collect::<Result<Vec<_>, _>>()?
    };
    let pushes = (0..hands.count).map(|i| {
        let mut within = |[least, most]: [f64; 2]| least + (most - least) * rng.random::<f64>();
        let lasts_s = within(hands.duration_s);
        let on_s = hands.after_s + f64::from(i) * part_s + within([0.0, part_s - lasts_s]);
        let force_n = within(hands.force_n);
        let offset_m = [0; 3].map(|_| within([-REACH_M, REACH_M]));
        let link = links[rng.random_range(0..links.len())];
        let direction: [f64; 3] = UnitSphere.sample(&mut rng);
        let com_m = model.links()[link].com_m();
        Push {
            link,
            point_m: std::array::from_fn(|k| com_m[k] + offset_m[k]),
            force_n: direction.map(|d| force_n * d),
            on_s,
            off_s: on_s + lasts_s,
            rise_s: hands.rise_s,
            profile: hands.profile,
            kind: hands.kind,
            label: hands.label.clone(),
        }
    });
    Ok(pushes.collect())
}

/// Returns the index of a link, which a joint must move: otherwise no joint would feel the push.
fn moving_link(
    spec: &RecordingSpec,
    model: &Model,
    what: &'static str,
    name: &str,
) -> Result<usize, ScenarioError> {
    let link = find_link(model, what, name)?;
    match model.links()[link].joint {
        Some(_) => Ok(link),
        None => Err(ScenarioError::FixedLink {
            recording: spec.name.clone(),
            what,
            link: name.to_owned(),
        }),
    }
}

/// Returns the index of a link in the model.
pub(super) fn find_link(
    model: &Model,
    what: &'static str,
    name: &str,
) -> Result<usize, ScenarioError> {
    model
        .link_index(name)
        .ok_or_else(|| ScenarioError::UnknownLink {
            what,
            link: name.to_owned(),
            known: model
                .links()
                .iter()
                .map(|link| link.name.as_str())
                .collect::<Vec<_>>()
                .join(", "),
        })
}
