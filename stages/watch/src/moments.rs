//! Normal equations of one joint's residual, and the score of a change in a window of them against a reference.

use nalgebra::{ArrayStorage, Cholesky, Const, SMatrix, SVector};

/// Columns of a joint's own regression: 1, expected effort, direction, velocity, and direction times the
/// magnitude of the expected effort.
/// Physical: offset, gain, Coulomb, viscous and load-dependent friction.
pub(super) const COLUMNS: usize = 5;
/// Index of the column of the expected effort.
const EXPECTED: usize = 1;

/// Index of an offset in [`JointScore`], and of its column.
pub(super) const BIAS: usize = 0;
/// Index of a gain in [`JointScore`].
pub(super) const GAIN: usize = 1;
/// Index of Coulomb friction in [`JointScore`], and of its column.
pub(super) const COULOMB: usize = 2;
/// Kinds of change at a joint; viscous friction is the last.
/// Physical: offset, gain, Coulomb and viscous friction.
pub(super) const JOINT_KINDS: usize = 4;

/// Minimum share of a change's information that remains after the reference is marginalised, for it to be scored.
/// Statistical: a variance inflation factor of 1 / 0.05 = 20; columns with more than 10 are called collinear.
const LEAST_INFORMATION: f64 = 0.05;

/// Relative increase of each diagonal element before a Cholesky factorisation.
/// Resolution: guards the factorisation of dependent columns.
const RIDGE: f64 = 1e-7;
/// Increase of each diagonal element before a Cholesky factorisation, relative to the largest one.
/// Resolution: guards the factorisation where a column is zero.
const RIDGE_OF_LARGEST: f64 = 1e-12;

pub(super) type Coefficients = SVector<f64, COLUMNS>;
type Gram = SMatrix<f64, COLUMNS, COLUMNS>;

/// One row of one joint.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct JointRow {
    /// The regression's columns, through the twin's low-pass.
    pub columns: [f64; COLUMNS],
    /// Filtered residual \[effort unit\].
    pub residual: f64,
}

/// Sums of products of a joint's columns and residual.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moments {
    gram: Gram,
    with_residual: Coefficients,
    residual: f64,
    /// Number of rows.
    pub rows: f64,
}

impl Moments {
    pub const ZERO: Self = Self {
        gram: SMatrix::from_array_storage(ArrayStorage([[0.0; COLUMNS]; COLUMNS])),
        with_residual: SMatrix::from_array_storage(ArrayStorage([[0.0; COLUMNS]])),
        residual: 0.0,
        rows: 0.0,
    };

    /// Returns all numbers as a flat list.
    pub fn numbers(&self) -> Vec<f64> {
        let products = self.gram.iter().chain(&self.with_residual);
        products
            .copied()
            .chain([self.residual, self.rows])
            .collect()
    }

    /// Restores moments from the list of [`Moments::numbers`]; `None` if its length differs.
    pub fn of_numbers(numbers: &[f64]) -> Option<Self> {
        let (gram, rest) = numbers.split_at_checked(COLUMNS * COLUMNS)?;
        let (with_residual, rest) = rest.split_at_checked(COLUMNS)?;
        let [residual, rows] = *<&[f64; 2]>::try_from(rest).ok()?;
        Some(Self {
            gram: Gram::from_column_slice(gram),
            with_residual: Coefficients::from_column_slice(with_residual),
            residual,
            rows,
        })
    }

    pub fn add_row(&mut self, row: &JointRow) {
        let x = Coefficients::from(row.columns);
        self.gram.ger(1.0, &x, &x, 1.0);
        self.with_residual.axpy(row.residual, &x, 1.0);
        self.residual += row.residual * row.residual;
        self.rows += 1.0;
    }

    /// Adds `weight` times `other`; -1 subtracts it.
    pub fn add(&mut self, other: &Self, weight: f64) {
        self.gram += other.gram * weight;
        self.with_residual += other.with_residual * weight;
        self.residual += other.residual * weight;
        self.rows += other.rows * weight;
    }

    pub fn scale(&mut self, factor: f64) {
        self.gram *= factor;
        self.with_residual *= factor;
        self.residual *= factor;
        self.rows *= factor;
    }

    /// Returns the sum of squares of the residual after the regression with `coefficients` is subtracted.
    fn energy(&self, coefficients: &Coefficients) -> f64 {
        let fitted = self.gram * coefficients;
        let explained = 2.0 * coefficients.dot(&self.with_residual) - coefficients.dot(&fitted);
        (self.residual - explained).max(0.0)
    }
}

/// Returns the Cholesky factor. The diagonal is raised slightly, which only matters in directions without
/// information.
fn factor<const N: usize>(gram: &SMatrix<f64, N, N>) -> Option<Cholesky<f64, Const<N>>> {
    let largest = (0..N).fold(0.0, |largest: f64, i| largest.max(gram[(i, i)]));
    if largest <= 0.0 {
        return None;
    }
    let mut raised = *gram;
    for i in 0..N {
        raised[(i, i)] += RIDGE * gram[(i, i)] + RIDGE_OF_LARGEST * largest;
    }
    Cholesky::new(raised)
}

/// The baseline residual of a joint: its regression coefficients and the sums from which they follow.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reference {
    pub moments: Moments,
    pub coefficients: Coefficients,
}

impl Reference {
    pub const EMPTY: Self = Self {
        moments: Moments::ZERO,
        coefficients: SMatrix::from_array_storage(ArrayStorage([[0.0; COLUMNS]])),
    };

    pub fn of(moments: Moments) -> Self {
        let factor = factor(&moments.gram);
        Self {
            coefficients: factor.map_or_else(Coefficients::zeros, |factor| {
                factor.solve(&moments.with_residual)
            }),
            moments,
        }
    }

    /// Returns the mean square of the residual in `window` after the reference is subtracted \[effort unit²\].
    pub fn energy_per_row(&self, window: &Moments) -> f64 {
        window.energy(&self.coefficients) / window.rows.max(1.0)
    }

    /// Returns the mean square of the effort predicted by twin and reference together \[effort unit²\].
    pub fn effort_square(&self) -> f64 {
        let c = self.direction(GAIN);
        c.dot(&(self.moments.gram * c)) / self.moments.rows.max(1.0)
    }

    /// Returns a kind of change as a direction in the columns. A gain multiplies the measured effort, so its
    /// direction is the expected effort plus the reference's residual.
    fn direction(&self, kind: usize) -> Coefficients {
        let mut c = Coefficients::zeros();
        if kind == GAIN {
            c = self.coefficients;
            c[EXPECTED] += 1.0;
        } else {
            c[kind] = 1.0;
        }
        c
    }
}

/// Gain and size of each kind of change in a window of one joint.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct JointScore {
    /// Sum of squares that the change explains \[effort unit²\].
    pub gain: [f64; JOINT_KINDS],
    /// Size of the change by least squares.
    pub size: [f64; JOINT_KINDS],
}

/// Comparison of a window of one joint with its reference, whose coefficients are marginalised. Let A be the window's
/// Gram matrix, v the score of its innovation and R the reference's Gram matrix. The information on a change along
/// the columns is then A - A (A + R)⁻¹ A, and the score is v - A (A + R)⁻¹ v.
pub(super) struct Compared<'a> {
    window: &'a Moments,
    reference: &'a Reference,
    factor: Cholesky<f64, Const<COLUMNS>>,
    settled: Coefficients,
    score: Coefficients,
    information: Gram,
}

impl<'a> Compared<'a> {
    /// Compares a window with its reference; `None` if the window is empty, or if neither has any information.
    pub fn new(window: &'a Moments, reference: &'a Reference) -> Option<Self> {
        if window.rows < 1.0 {
            return None;
        }
        let factor = factor(&(window.gram + reference.moments.gram))?;
        let innovation = window.with_residual - window.gram * reference.coefficients;
        let settled = factor.solve(&innovation);
        Some(Self {
            score: innovation - window.gram * settled,
            information: window.gram - window.gram * factor.solve(&window.gram),
            window,
            reference,
            factor,
            settled,
        })
    }

    /// Returns the gain of each kind of change: (c·score)² / (c·information c) for a change along c.
    pub fn joint(&self) -> JointScore {
        let mut result = JointScore::default();
        for kind in 0..JOINT_KINDS {
            let c = self.reference.direction(kind);
            let information = c.dot(&(self.information * c));
            let whole = c.dot(&(self.window.gram * c));
            if information > LEAST_INFORMATION * whole {
                let score = c.dot(&self.score);
                result.gain[kind] = score * score / information;
                result.size[kind] = score / information;
            }
        }
        result
    }

    /// Returns information and score of a change of the whole arm.
    pub fn outer<const D: usize>(&self, outer: &Outer<D>) -> OuterScore<D> {
        let known = outer.cross * self.reference.coefficients;
        OuterScore {
            information: outer.gram - outer.cross * self.factor.solve(&outer.cross.transpose()),
            score: outer.with_residual - known - outer.cross * self.settled,
        }
    }

    /// Returns the estimated share of a change of this kind and size in the window, and the information on that
    /// share.
    pub fn share(&self, kind: usize, size: f64) -> (f64, f64) {
        let c = self.reference.direction(kind) * size;
        let information = c.dot(&(self.information * c));
        (c.dot(&self.score) / information, information)
    }
}

/// Sums of products for a change of the whole arm at one joint: of its columns (a payload's mass and first moments,
/// or a force) with the columns of the joint's own regression.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outer<const D: usize> {
    cross: SMatrix<f64, D, COLUMNS>,
    gram: SMatrix<f64, D, D>,
    with_residual: SVector<f64, D>,
}

impl<const D: usize> Outer<D> {
    pub fn zero() -> Self {
        Self {
            cross: SMatrix::zeros(),
            gram: SMatrix::zeros(),
            with_residual: SVector::zeros(),
        }
    }

    pub fn add_row(&mut self, columns: &[f64; D], row: &JointRow) {
        let d = SVector::<f64, D>::from(*columns);
        self.cross
            .ger(1.0, &d, &Coefficients::from(row.columns), 1.0);
        self.gram.ger(1.0, &d, &d, 1.0);
        self.with_residual.axpy(row.residual, &d, 1.0);
    }

    pub fn add(&mut self, other: &Self) {
        self.cross += other.cross;
        self.gram += other.gram;
        self.with_residual += other.with_residual;
    }
}

/// Information and score of a change of the whole arm in a window, summed over joints.
#[derive(Debug, Clone, Copy)]
pub(super) struct OuterScore<const D: usize> {
    information: SMatrix<f64, D, D>,
    score: SVector<f64, D>,
}

impl<const D: usize> OuterScore<D> {
    pub fn zero() -> Self {
        Self {
            information: SMatrix::zeros(),
            score: SVector::zeros(),
        }
    }

    pub fn add(&mut self, other: &Self, weight: f64) {
        self.information += other.information * weight;
        self.score += other.score * weight;
    }

    /// Returns the least-squares change and its gain.
    pub fn solve(&self) -> Option<([f64; D], f64)> {
        let change = factor(&self.information)?.solve(&self.score);
        Some((change.into(), change.dot(&self.score)))
    }

    /// Returns the estimated share of `change` in the window, and the information on that share.
    pub fn share(&self, change: &[f64; D]) -> (f64, f64) {
        let change = SVector::<f64, D>::from(*change);
        let information = change.dot(&(self.information * change));
        (change.dot(&self.score) / information, information)
    }
}
