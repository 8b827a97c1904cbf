//! Where a wall could be: from the force at the end of the arm that the residual asks for.

use nalgebra::{Matrix3, Point3, Vector3};
use tauscope_dynamics::{Data, forward_kinematics, link_jacobian, link_pose};

use crate::physics::active::Hypothesis;
use crate::select::propose::{Base, Proposal};

/// A sample belongs to a contact if a force there gains this much of the sum of squares over the variance.
const EVIDENT: f64 = 30.0;
/// Fewer samples than this are no wall.
const LEAST_SAMPLES: usize = 8;
/// Quantiles of the depth of the contact samples at which the wall's surface is tried.
const SURFACES: [f64; 4] = [0.0, 0.05, 0.2, 0.4];

impl Base<'_> {
    /// The best wall: its normal is the direction of the force, its surface where the force begins. What is evident beside all that
    /// is left finds a wall that is met now and then, what is beside the noise one that is leant on nearly all the time.
    pub fn propose_wall(&self, hypothesis: Hypothesis) -> Option<Proposal> {
        let noise = self.problem.white_noise.iter();
        let noise: Vec<f64> = noise.map(|sigma| (sigma * sigma).max(1e-16)).collect();
        let [left, noise] =
            [&self.fit.variance, &noise].map(|variance| self.wall_of(hypothesis, variance));
        let gain = |wall: &Option<(f64, [f64; 4])>| wall.map_or(f64::NEG_INFINITY, |wall| wall.0);
        let best = if gain(&noise) > gain(&left) {
            noise
        } else {
            left
        };
        self.propose_at(hypothesis, &best?.1)
    }

    /// The gain and the shape of the best wall, from forces that are evident beside these variances of the joints.
    fn wall_of(&self, hypothesis: Hypothesis, variance: &[f64]) -> Option<(f64, [f64; 4])> {
        let contacts = self.contacts(variance);
        if contacts.len() < LEAST_SAMPLES {
            return None;
        }
        let total: Vector3<f64> = contacts.iter().map(|(_, force)| force).sum();
        let mut direction = -total.try_normalize(1e-9)?;
        let mut best: Option<(f64, [f64; 4])> = None;
        // The force of each sample is uncertain where the arm cannot feel it; leaning towards those that agree helps.
        for _ in 0..3 {
            let agreeing: Vector3<f64> = contacts
                .iter()
                .filter(|(_, force)| -force.dot(&direction) > 0.7 * force.norm())
                .map(|(_, force)| force)
                .sum();
            direction = -agreeing.try_normalize(1e-9)?;
            let mut depths: Vec<f64> = contacts
                .iter()
                .map(|(point, _)| direction.dot(&point.coords))
                .collect();
            depths.sort_by(f64::total_cmp);
            for quantile in SURFACES {
                let offset = depths[(quantile * (depths.len() - 1) as f64) as usize] - 0.005;
                let azimuth = direction.y.atan2(direction.x);
                let elevation = direction.z.clamp(-1.0, 1.0).asin();
                let shape = [0.0, azimuth, elevation, offset];
                if let Some(gain) = self.first_order_score_at(hypothesis, &shape)
                    && best.is_none_or(|(most, _)| gain > most)
                {
                    best = Some((gain, shape));
                }
            }
        }
        best
    }

    /// Samples at which a force on the last moving link is evident: where its frame is, and the force \[N\].
    fn contacts(&self, variance: &[f64]) -> Vec<(Point3<f64>, Vector3<f64>)> {
        let problem = self.problem;
        let n = problem.joints;
        let Some(last) = problem.model.joints().last() else {
            return Vec::new();
        };
        let link = last.child_link;
        let mut data = Data::new(&problem.model);
        let mut found = Vec::new();
        for track in &problem.tracks {
            for (row, &k) in track.rows().zip(&track.compared) {
                let position = &track.track.position[k * n..(k + 1) * n];
                forward_kinematics(&problem.model, &mut data, position);
                let point = link_pose(&problem.model, &data, link).translation.vector;
                let jacobian = link_jacobian(&problem.model, &mut data, link);
                let mut normal = Matrix3::zeros();
                let mut right = Vector3::zeros();
                for j in 0..n {
                    let at = j * problem.rows + row;
                    let weight = 1.0 / variance[j];
                    let column = Vector3::new(jacobian[(0, j)], jacobian[(1, j)], jacobian[(2, j)]);
                    normal += weight * column * column.transpose();
                    right -= weight * self.fit.residual[at] * column;
                }
                let ridge = 1e-3 * normal.trace();
                let Some(factor) = (normal + Matrix3::identity() * ridge).cholesky() else {
                    continue;
                };
                let force: Vector3<f64> = factor.solve(&right);
                if right.dot(&force) > EVIDENT {
                    found.push((Point3::from(point), force));
                }
            }
        }
        found
    }
}
