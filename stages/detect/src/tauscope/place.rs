//! Isolation of a contact: the touched link, the point and the force.
//!
//! A force F at a point loads the joints with Jᵀ F, where J is the point's Jacobian: the residual is minus that. A
//! person may touch a link anywhere along it and around it, from any side. For each of a set of points, the
//! likelihood of the residual has a closed form if each component of F is normal with the standard deviation
//! [`HAND_N`]. The mean over a link's points is the evidence for the link (`MacKay`, "Information Theory, Inference
//! and Learning Algorithms", 2003, chapter 28). So a link gains nothing from merely having many points, of which one
//! explains the residual by chance. The evidence is summed over the whole contact, from its first sample to the last
//! whose score reaches the threshold.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use tauscope_bus::{JointArray, MAX_JOINTS, TwinState};

use super::points::{POINTS, Points};
use super::spans::{SHORTEST, WINDOWS_S};
use super::windows::Windows;
use crate::frame::{Contact, LoadedJoints, Seen, Setup};

/// Standard deviation of each component of a contact force \[N\].
/// Chosen: a force then has a root mean square of 17 N, about the geometric mean of the 7 to 45 N in
/// `tests/contacts/paths.py`. A smaller value underestimates hard pushes, a larger one favours links that fewer
/// joints sense.
const HAND_N: f64 = 10.0;
/// Model error of the twin, as a share of the residual. It limits the precision for strong forces.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const MODEL_ERROR: f64 = 0.05;
/// Correlation time of the residual's error \[s\]. Samples closer than this, or closer than the window that they are
/// averaged over, count as one.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const CORRELATED_S: f64 = 0.1;
/// Interval between two isolations of a contact \[ns\].
/// Resolution: twelve isolations in [`CORRELATED_S`]; changes the computing time and the age of the reported place.
const EVERY_NS: i64 = 8_000_000;
/// Probability from which a link is reported alone; below it, the next most probable link is reported, too.
/// Tuned: on seed 841 of `tests/contacts/paths.py`, swept over 0.8, 0.9 and 0.95: of the contacts reported at one
/// link alone, 87, 88 and 87 % were there.
const SURE: f64 = 0.9;
/// Force on the tool that explains the residual best, and velocity of the touched point, in the world frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ToolTouch {
    pub force_n: Vector3<f64>,
    pub velocity_m_per_s: Vector3<f64>,
    /// Share of the squared residual that the force explains, at most 1.
    pub share: f64,
}

/// Locates contacts on one robot. No allocation per call.
#[derive(Debug)]
pub(crate) struct Place {
    points: Option<Points>,
    effort_per_nm: Vec<f64>,
    /// Log evidence by joint that carries the link, and the duration over which it was summed \[correlation times\].
    evidence: JointArray,
    gathered: f64,
    loaded: LoadedJoints,
    /// Time and result of the newest isolation.
    newest: Option<(i64, Contact)>,
}

/// A residual in units of its noise, as normal equations for a force.
struct Load {
    joints: usize,
    /// Information matrix of the joint torques, and right-hand side of the equations.
    weights: [[f64; MAX_JOINTS]; MAX_JOINTS],
    pull: JointArray,
    /// Squared Mahalanobis length of the residual.
    total: f64,
}

/// Normal equations for a force and a torque at a link's origin.
struct Wrench {
    information: Matrix6<f64>,
    pull: Vector6<f64>,
}

impl Load {
    /// Sets up the equations for a mean `residual` over a window.
    fn new(residual: &JointArray, windows: &Windows, window: usize, effort_per_nm: &[f64]) -> Self {
        let n = windows.joints();
        let inverse = windows.inverse_correlation(window);
        let (mut z, mut scale) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for j in 0..n {
            let mean = residual[j];
            let noise = windows.noise(window, j).hypot(MODEL_ERROR * mean);
            // residual = -Jᵀ F. A joint whose effort gives no torque holds no information about the force.
            if effort_per_nm[j].is_finite() {
                z[j] = mean / noise;
                scale[j] = -effort_per_nm[j] / noise;
            }
        }
        let mut load = Self {
            joints: n,
            weights: [[0.0; MAX_JOINTS]; MAX_JOINTS],
            pull: [0.0; MAX_JOINTS],
            total: 0.0,
        };
        for a in 0..n {
            for b in 0..n {
                let entry = inverse[a * n + b];
                load.weights[a][b] = scale[a] * entry * scale[b];
                load.pull[a] += scale[a] * entry * z[b];
                load.total += z[a] * entry * z[b];
            }
        }
        load
    }

    /// Transforms the equations to a link whose frame moves with `columns`: by joint, the linear and the angular
    /// velocity.
    fn at(&self, columns: &[Vector6<f64>; MAX_JOINTS]) -> Wrench {
        let (mut information, mut pull) = (Matrix6::zeros(), Vector6::zeros());
        for a in 0..self.joints {
            // A force on a link loads only the joints between it and the base.
            if columns[a] == Vector6::zeros() {
                continue;
            }
            let mut weighted = Vector6::zeros();
            for (column, weight) in columns.iter().zip(&self.weights[a]).take(self.joints) {
                weighted += column * *weight;
            }
            information += columns[a] * weighted.transpose();
            pull += columns[a] * self.pull[a];
        }
        Wrench { information, pull }
    }
}

impl Wrench {
    /// Returns information matrix and right-hand side for a force that acts at `arm` from the link's origin.
    fn force_at(&self, arm: &Vector3<f64>) -> (Matrix3<f64>, Vector3<f64>) {
        // The point moves with linear + angular × arm.
        let cross = arm.cross_matrix();
        let linear = self.information.fixed_view::<3, 3>(0, 0);
        let mixed = self.information.fixed_view::<3, 3>(0, 3) * cross.transpose();
        let angular = cross * self.information.fixed_view::<3, 3>(3, 3) * cross.transpose();
        let pull = self.pull.fixed_rows::<3>(0) - cross * self.pull.fixed_rows::<3>(3);
        (linear - mixed - mixed.transpose() + angular, pull)
    }
}

/// Returns the most probable force, and the log evidence for a force at its point relative to no force at all.
fn most_probable(information: &Matrix3<f64>, pull: &Vector3<f64>) -> (Vector3<f64>, f64) {
    let scaled = information * HAND_N.powi(2) + Matrix3::identity();
    let Some(inverse) = scaled.try_inverse() else {
        return (Vector3::zeros(), f64::NEG_INFINITY);
    };
    let force = inverse * pull * HAND_N.powi(2);
    let evidence = 0.5 * (pull.dot(&force) - scaled.determinant().ln());
    (force, evidence)
}

/// Returns the weighted mean of the values, and the logarithm of the sum of the weights. `logs` are the logarithms of
/// the weights.
fn weighted<const N: usize>(
    logs: &[f64],
    values: &[[Vector3<f64>; N]],
) -> ([Vector3<f64>; N], f64) {
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (mut sums, mut sum) = ([Vector3::zeros(); N], 0.0);
    if !largest.is_finite() {
        return (sums, f64::NEG_INFINITY);
    }
    for (log, values) in logs.iter().zip(values) {
        let weight = (log - largest).exp();
        sum += weight;
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum += value * weight;
        }
    }
    let mean = sums.map(|value| value / sum);
    (mean, largest + sum.ln())
}

/// Returns the entry with the largest log probability, and the next one if the first is less probable than [`SURE`].
fn most_likely(logs: &[f64]) -> Option<(usize, Option<usize>)> {
    let most = |without: Option<usize>| {
        let others = (logs.iter().enumerate()).filter(|(at, _)| Some(*at) != without);
        others.max_by(|(_, a), (_, b)| a.total_cmp(b))
    };
    let (best, largest) = most(None)?;
    let sum: f64 = logs.iter().map(|log| (log - largest).exp()).sum();
    let other = most(Some(best)).filter(|_| sum.recip() < SURE);
    Some((best, other.map(|(at, _)| at)))
}

impl Place {
    pub fn new(setup: &Setup) -> Self {
        let joints = setup.joints.iter();
        let effort_per_nm: Vec<f64> = joints.map(|joint| joint.effort_per_nm).collect();
        Self {
            points: Points::new(setup),
            effort_per_nm,
            evidence: [0.0; MAX_JOINTS],
            gathered: 0.0,
            loaded: LoadedJoints::default(),
            newest: None,
        }
    }

    /// Starts another contact.
    pub fn begin(&mut self) {
        self.evidence = [0.0; MAX_JOINTS];
        self.gathered = 0.0;
        self.loaded = LoadedJoints::default();
        self.newest = None;
    }

    /// Returns joints, link and force of the contact that began at `contact_ns`. To be called with each of its
    /// samples. Samples with a score below the `threshold` do not change joints and link.
    pub fn see(
        &mut self,
        sample: &TwinState,
        windows: &Windows,
        contact_ns: i64,
        threshold: f64,
    ) -> Seen {
        let counts = windows.newest_score() >= threshold || self.loaded.is_empty();
        if counts {
            let w = windows.since(contact_ns);
            let joints = (0..windows.joints()).map(|j| (windows.excess(w, j), windows.noise(w, j)));
            self.loaded.add(windows.newest_score(), joints);
        }
        Seen {
            contact_ns,
            joints: Some(self.loaded.mask()),
            place: self.locate(sample, windows, contact_ns, counts),
        }
    }

    /// Returns the link with the largest evidence since the contact began, and the mean force. Both are from an
    /// isolation that is no older than [`EVERY_NS`]. The evidence of the sample is added if it `counts`.
    fn locate(
        &mut self,
        sample: &TwinState,
        windows: &Windows,
        contact_ns: i64,
        counts: bool,
    ) -> Option<Contact> {
        let now_ns = sample.header.stamp_ns;
        let newest = self.newest.filter(|(at_ns, _)| now_ns - at_ns < EVERY_NS);
        if let Some((_, contact)) = newest {
            return Some(contact);
        }
        let points = self.points.as_mut()?;
        let n = windows.joints();
        let window = windows.since(contact_ns);
        let mut residual = [0.0; MAX_JOINTS];
        for (j, residual) in residual.iter_mut().enumerate().take(n) {
            let (excess, noise) = (windows.excess(window, j), windows.noise(window, j));
            *residual = self.loaded.limit(j, excess, noise);
        }
        let load = Load::new(&residual, windows, window, &self.effort_per_nm);
        let before_ns = self.newest.map_or(now_ns, |(at_ns, _)| at_ns);
        let correlated_s = WINDOWS_S[window].max(CORRELATED_S);
        let share = if counts {
            ((now_ns - before_ns) as f64 * 1e-9 / correlated_s).clamp(1e-3, 1.0)
        } else {
            0.0
        };
        self.gathered += share;
        let mut links = [None; MAX_JOINTS];
        let mut means = [[Vector3::zeros(); 2]; MAX_JOINTS];
        points.each_link(sample, |joint, link| {
            let wrench = load.at(&link.columns);
            let mut logs = [f64::NEG_INFINITY; POINTS];
            let mut found = [[Vector3::zeros(); 2]; POINTS];
            let mut weights = 0.0;
            let slots = logs.iter_mut().zip(&mut found);
            for ((log, found), (arm, weight)) in slots.zip(link.around()) {
                let (information, pull) = wrench.force_at(&arm);
                let (force, evidence) = most_probable(&information, &pull);
                (*log, *found) = (evidence + f64::ln(weight), [force, link.origin_m + arm]);
                weights += weight;
            }
            let (mean, evidence) = weighted(&logs, &found);
            self.evidence[joint] += share * (evidence - weights.ln());
            (links[joint], means[joint]) = (Some(link.link), mean);
        });
        // Evidence from less than a correlation time has the weight of one independent sample.
        let scale = self.gathered.recip().max(1.0);
        let logs: JointArray = std::array::from_fn(|joint| match links[joint] {
            Some(_) => self.evidence[joint] * scale,
            None => f64::NEG_INFINITY,
        });
        let (best, other) = most_likely(&logs[..n])?;
        let ([force, _], _) = weighted(&logs[..n], &means[..n]);
        let contact = Contact {
            link: links[best]?,
            other_link: other.and_then(|other| links[other]),
            force_n: force.into(),
            point_m: means[best][1].into(),
        };
        self.newest = Some((now_ns, contact));
        Some(contact)
    }

    /// Returns the force on the tool that explains the residual's `rise` best \[effort unit\]. `velocity` is that of
    /// the joints before the rise \[rad/s\].
    pub fn on_tool(
        &mut self,
        sample: &TwinState,
        windows: &Windows,
        rise: &JointArray,
        velocity: &JointArray,
    ) -> Option<ToolTouch> {
        let points = self.points.as_mut()?;
        let load = Load::new(rise, windows, SHORTEST, &self.effort_per_nm);
        let tool_joint = points.tool_joint();
        let mut touch = None;
        points.each_link(sample, |joint, link| {
            if Some(joint) != tool_joint {
                return;
            }
            let (information, pull) = load.at(&link.columns).force_at(&link.end_m);
            let (force_n, _) = most_probable(&information, &pull);
            let explained = 2.0 * pull.dot(&force_n) - force_n.dot(&(information * force_n));
            let moved = link.columns.iter().zip(velocity).take(load.joints);
            let velocity: Vector6<f64> = moved.map(|(column, rate)| column * *rate).sum();
            let angular = velocity.fixed_rows::<3>(3);
            touch = Some(ToolTouch {
                force_n,
                velocity_m_per_s: velocity.fixed_rows::<3>(0) + angular.cross(&link.end_m),
                share: explained / load.total.max(f64::MIN_POSITIVE),
            });
        });
        touch
    }

    /// Returns, by joint, the change of the measured effort per torque \[effort unit per N m\].
    pub fn effort_per_nm(&self) -> &[f64] {
        &self.effort_per_nm
    }

    /// Returns the evaluated points of the robot; `None` without a model.
    pub fn into_points(self) -> Option<Points> {
        self.points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_link_is_told_where_the_first_is_not_sure() {
        let logs = |shares: [f64; 3]| shares.map(f64::ln);
        assert_eq!(most_likely(&logs([0.02, 0.95, 0.03])), Some((1, None)));
        assert_eq!(most_likely(&logs([0.3, 0.1, 0.6])), Some((2, Some(0))));
        let none = f64::NEG_INFINITY;
        assert_eq!(most_likely(&[none, 3.0, none]), Some((1, None)));
        assert_eq!(most_likely(&[]), None);
    }
}
