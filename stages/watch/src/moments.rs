//! Normal equations of one joint's residual, and what a window of them says of a change against a
//! reference.

use nalgebra::{ArrayStorage, Cholesky, Const, SMatrix, SVector};

/// Columns of a joint's own regression: 1, expected effort, direction, velocity, and direction times the
/// size of the expected effort.
pub(super) const COLUMNS: usize = 5;
const EXPECTED: usize = 1;

/// What may change at a joint, by place in [`JointScore`]: those that are a column stand at its place.
pub(super) const BIAS: usize = 0;
pub(super) const GAIN: usize = 1;
pub(super) const COULOMB: usize = 2;
/// With viscous friction as the last.
pub(super) const JOINT_KINDS: usize = 4;

/// A direction keeps at least this share of its information beside a reference that is itself uncertain,
/// or the reference knows too little of it.
const LEAST_INFORMATION: f64 = 0.05;

pub(super) type Coefficients = SVector<f64, COLUMNS>;
type Gram = SMatrix<f64, COLUMNS, COLUMNS>;

/// One instant of one joint.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct JointRow {
    /// The regression's columns, behind the twin's low-pass.
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
    /// How many rows.
    pub rows: f64,
}

impl Moments {
    pub const ZERO: Self = Self {
        gram: SMatrix::from_array_storage(ArrayStorage([[0.0; COLUMNS]; COLUMNS])),
        with_residual: SMatrix::from_array_storage(ArrayStorage([[0.0; COLUMNS]])),
        residual: 0.0,
        rows: 0.0,
    };

    pub fn add_row(&mut self, row: &JointRow) {
        let x = Coefficients::from(row.columns);
        self.gram.ger(1.0, &x, &x, 1.0);
        self.with_residual.axpy(row.residual, &x, 1.0);
        self.residual += row.residual * row.residual;
        self.rows += 1.0;
    }

    /// Adds `weight` times `other`; -1 takes it away.
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

    /// Sum of the squared residual that `coefficients` leave.
    fn energy(&self, coefficients: &Coefficients) -> f64 {
        let fitted = self.gram * coefficients;
        let explained = 2.0 * coefficients.dot(&self.with_residual) - coefficients.dot(&fitted);
        (self.residual - explained).max(0.0)
    }
}

/// Cholesky factor, the diagonal raised so slightly that only what holds no information is touched.
fn factor<const N: usize>(gram: &SMatrix<f64, N, N>) -> Option<Cholesky<f64, Const<N>>> {
    let largest = (0..N).fold(0.0, |largest: f64, i| largest.max(gram[(i, i)]));
    if largest <= 0.0 {
        return None;
    }
    let mut raised = *gram;
    for i in 0..N {
        raised[(i, i)] += 1e-7 * gram[(i, i)] + 1e-12 * largest;
    }
    Cholesky::new(raised)
}

/// How a joint's residual is as a rule: its regression and what that rests on.
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

    /// Mean square of the residual that it leaves in `window`.
    pub fn energy_per_row(&self, window: &Moments) -> f64 {
        window.energy(&self.coefficients) / window.rows.max(1.0)
    }

    /// Mean square of the measured effort, as far as twin and reference explain it.
    pub fn effort_square(&self) -> f64 {
        let c = self.direction(GAIN);
        c.dot(&(self.moments.gram * c)) / self.moments.rows.max(1.0)
    }

    /// A kind of change as a direction in the columns. A gain multiplies all that is recorded, so its
    /// column is the expected effort with what the reference adds.
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

/// What a window of one joint explains by each kind of change.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct JointScore {
    /// Sum of squares that it explains \[effort unit²\].
    pub gain: [f64; JOINT_KINDS],
    /// Its size by least squares.
    pub size: [f64; JOINT_KINDS],
}

/// A window of one joint beside its reference, whose coefficients are marginalised: with A the window's
/// Gram matrix, v the scores of its innovation and R the reference's Gram matrix, the information on a
/// change along the columns is A - A (A + R)⁻¹ A and the score v - A (A + R)⁻¹ v.
pub(super) struct Compared<'a> {
    window: &'a Moments,
    reference: &'a Reference,
    factor: Cholesky<f64, Const<COLUMNS>>,
    settled: Coefficients,
    score: Coefficients,
    information: Gram,
}

impl<'a> Compared<'a> {
    /// `None` where both say nothing.
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

    /// What each kind of change explains: (c·score)² / (c·information c) for one along c.
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

    /// The same for a change whose columns are no joint's own.
    pub fn outer<const D: usize>(&self, outer: &Outer<D>) -> OuterScore<D> {
        let known = outer.cross * self.reference.coefficients;
        OuterScore {
            information: outer.gram - outer.cross * self.factor.solve(&outer.cross.transpose()),
            score: outer.with_residual - known - outer.cross * self.settled,
        }
    }

    /// Share of a change of this kind and size that the window holds, and the information on that share.
    pub fn share(&self, kind: usize, size: f64) -> (f64, f64) {
        let c = self.reference.direction(kind) * size;
        let information = c.dot(&(self.information * c));
        (c.dot(&self.score) / information, information)
    }
}

/// Sums of products of the columns that a change of the whole arm has at one joint (a payload's mass and
/// first moments; a force), with those of the joint's own regression.
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

/// What a window says of a change of the whole arm, summed over joints.
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

    /// The change by least squares, and what it explains.
    pub fn solve(&self) -> Option<([f64; D], f64)> {
        let change = factor(&self.information)?.solve(&self.score);
        Some((change.into(), change.dot(&self.score)))
    }

    /// Share of `change` that the window holds, and the information on that share.
    pub fn share(&self, change: &[f64; D]) -> (f64, f64) {
        let change = SVector::<f64, D>::from(*change);
        let information = change.dot(&(self.information * change));
        (change.dot(&self.score) / information, information)
    }
}
