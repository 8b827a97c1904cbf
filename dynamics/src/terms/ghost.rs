//! Bodies on top of those of the robot, and what they alone cost.

use super::{Effect, MotionSample, Site, Term};
use crate::{Data, Inertia, Model, rnea};

/// An inertia at a link, for good or for a while. The cost of bodies is linear in their inertias, so a
/// robot that is weightless but for this one gives it.
#[derive(Debug)]
pub(super) struct Ghost {
    effect: &'static Effect,
    coordinates: Vec<f64>,
    link: usize,
    inertia: Inertia,
    /// In each recording \[s from its start\]; `None` for good.
    window_s: Option<[f64; 2]>,
    model: Model,
    data: Data,
}

impl Ghost {
    pub fn boxed(
        effect: &'static Effect,
        site: &Site<'_>,
        coordinates: &[f64],
        inertia: Inertia,
        window_s: Option<[f64; 2]>,
    ) -> Box<dyn Term> {
        let model = site.model.ghost(site.link, inertia);
        Box::new(Self {
            effect,
            coordinates: coordinates.to_vec(),
            link: site.link,
            inertia,
            window_s,
            data: Data::new(&model),
            model,
        })
    }
}

impl Term for Ghost {
    fn effect(&self) -> &'static Effect {
        self.effect
    }

    fn coordinates(&self) -> &[f64] {
        &self.coordinates
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let there = |[start, end]: [f64; 2]| start <= at.recording_s && at.recording_s < end;
        if !self.window_s.is_none_or(there) {
            return;
        }
        let added = rnea(
            &self.model,
            &mut self.data,
            at.position,
            at.velocity,
            at.acceleration,
        );
        for (effort, added) in effort.iter_mut().zip(added) {
            *effort += added;
        }
    }

    fn alter(&self, model: &mut Model) -> bool {
        if self.window_s.is_some() {
            return false;
        }
        model.attach(self.link, self.inertia);
        true
    }

    fn inertia(&self) -> Option<(usize, Inertia)> {
        self.window_s.is_none().then_some((self.link, self.inertia))
    }
}
