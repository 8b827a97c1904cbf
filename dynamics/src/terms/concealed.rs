//! Random effects for a simulated cell to conceal: the shape is drawn, and the size is chosen from a range so that it
//! is detectable.

use super::Site;
use crate::{Data, mass_matrix};

/// Largest share of the motor's effort that friction and springs may take.
/// Chosen: for simulated cells only; more than half of the motor's effort stays for the motion.
const LARGEST_SHARE: f64 = 0.4;
/// Smallest size tried, as a share of the largest.
/// Resolution: lower end of a bisection, far below what noise reveals.
const SMALLEST: f64 = 1e-4;

/// Parameters by name, as in files.
pub type Parameters = Vec<(&'static str, f64)>;

/// Pseudo-random numbers from a seed.
pub trait Chance {
    /// A random number between two.
    fn between(&mut self, least: f64, most: f64) -> f64;
    /// A random integer from `least` to `most`.
    fn whole(&mut self, least: u32, most: u32) -> u32;
    /// A random boolean.
    fn coin(&mut self) -> bool;
}

/// The place where an effect is drawn, and the motions planned there.
pub struct Draw<'a> {
    /// The place.
    pub site: Site<'a>,
    /// Largest effort of the joint's motor \[N m or N\].
    pub motor_nm: f64,
    /// Largest effort of the rigid body at the joint \[N m or N\].
    pub largest_nm: f64,
    /// Highest speed of the joint \[rad/s or m/s\].
    pub fastest_rad_s: f64,
    /// Highest acceleration of the joint \[rad/s² or m/s²\].
    pub largest_acceleration_rad_s2: f64,
    /// Middle of the joint's range \[rad or m\].
    pub middle_rad: f64,
    /// Half the width of the joint's range \[rad or m\].
    pub half_range_rad: f64,
    /// Length of the shortest recording \[s\].
    pub shortest_s: f64,
    /// Start of the drawn recording in the session \[s\].
    pub start_session_s: f64,
    /// The motions: time since the start of the recording \[s\], and position per joint \[rad or m\].
    pub path: Vec<(f64, &'a [f64])>,
    /// A random number between 0 and 1.
    pub share: f64,
    /// A random direction; zero for terms in a joint.
    pub direction: [f64; 3],
    /// 1 or -1 at random; 1 for all but terms of the recording.
    pub sign: f64,
    /// More random numbers.
    pub chance: &'a mut dyn Chance,
}

impl std::fmt::Debug for Draw<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Draw")
            .field("site", &self.site)
            .finish_non_exhaustive()
    }
}

impl Draw<'_> {
    /// Smallest and largest effort of friction and springs \[N m or N\].
    pub fn efforts_nm(&self) -> [f64; 2] {
        let most = LARGEST_SHARE * self.motor_nm;
        [SMALLEST * most, most]
    }

    /// Inertia that the joint moves at the beginning of the first motion \[kg m²\].
    pub fn moved_kgm2(&self) -> Option<f64> {
        let (_, position) = self.path.first()?;
        let model = self.site.model;
        let j = self.site.joint;
        Some(mass_matrix(model, &mut Data::new(model), position)[(j, j)])
    }

    /// Three components of a vector of this size in the random direction.
    pub fn along(&self, names: [&'static str; 3]) -> impl Fn(f64) -> Parameters + use<> {
        let direction = self.direction;
        move |size| names.into_iter().zip(direction.map(|d| d * size)).collect()
    }
}

/// A drawn effect whose size is still free.
pub struct Drawn {
    /// Smallest and largest size.
    pub sizes: [f64; 2],
    /// Parameters by size.
    pub parameters: Box<dyn Fn(f64) -> Parameters>,
}

impl std::fmt::Debug for Drawn {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Drawn")
            .field("sizes", &self.sizes)
            .finish_non_exhaustive()
    }
}

impl Drawn {
    /// `None` if the range of sizes is empty or not finite.
    pub fn new(sizes: [f64; 2], parameters: impl Fn(f64) -> Parameters + 'static) -> Option<Self> {
        let possible = sizes[0] > 0.0 && sizes[0] < sizes[1] && sizes[1].is_finite();
        possible.then(|| Self {
            sizes,
            parameters: Box::new(parameters),
        })
    }
}
