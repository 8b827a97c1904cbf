//! Bodies added to those of the robot, and their effort alone.

use super::{Effect, MotionSample, Site, Term};
use crate::{Data, Inertia, Model, rnea};

/// Time during which a body is present.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum While {
    /// Permanently.
    Always,
    /// Between two times of each recording \[s from its start\].
    InEachRecording([f64; 2]),
    /// Between two times of the session \[s\].
    InSession([f64; 2]),
}

impl While {
    /// Share of a sample during which it is present, 0 to 1.
    pub fn share(self, at: &MotionSample<'_>) -> f64 {
        let (now_s, [start_s, end_s]) = match self {
            Self::Always => return 1.0,
            Self::InEachRecording(window_s) => (at.recording_s, window_s),
            Self::InSession(window_s) => (at.session_s, window_s),
        };
        (at.share_after(now_s, start_s) - at.share_after(now_s, end_s)).max(0.0)
    }
}

/// An inertia at a link, permanent or temporary. The effort of bodies is linear in their inertias, so it is computed
/// with a robot that is massless except for this one.
#[derive(Debug)]
pub(super) struct Ghost {
    effect: &'static Effect,
    coordinates: Vec<f64>,
    link: usize,
    inertia: Inertia,
    there: While,
    model: Model,
    data: Data,
}

impl Ghost {
    pub fn boxed(
        effect: &'static Effect,
        site: &Site<'_>,
        coordinates: &[f64],
        inertia: Inertia,
        there: While,
    ) -> Box<dyn Term> {
        let model = site.model.ghost(site.link, inertia);
        Box::new(Self {
            effect,
            coordinates: coordinates.to_vec(),
            link: site.link,
            inertia,
            there,
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
        let share = self.there.share(at);
        if share <= 0.0 {
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
            *effort += share * added;
        }
    }

    fn alter(&self, model: &mut Model) -> bool {
        if self.there != While::Always {
            return false;
        }
        model.attach(self.link, self.inertia);
        true
    }

    fn inertia(&self) -> Option<(usize, Inertia)> {
        (self.there == While::Always).then_some((self.link, self.inertia))
    }

    fn inertia_at(&self, at: &MotionSample<'_>) -> Option<(usize, Inertia)> {
        let share = self.there.share(at);
        let ten = self.inertia.parameters().map(|x| share * x);
        (share > 0.0).then(|| (self.link, Inertia::from_parameters(ten)))
    }
}
