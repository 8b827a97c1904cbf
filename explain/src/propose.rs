//! Step 5, propose: where the search for an explanation begins.
//!
//! In: the data of step 2 and a fit. Out: the shapes of each effect that are tried (`grid`), the times at which something may
//! have begun or ended, scanned with running sums (`windows`, `moments`), the walls that contacts suggest (`wall`), and
//! what a curve may be a function of (`curve_axes`).
//!
//! At each grid point the factors are solved for, as in variable projection (Golub and Pereyra, *SIAM Journal on Numerical
//! Analysis* 10, 1973). The values here only rank shapes and times of one effect: effects are compared by `inference`.
//!
//! Each constant says where its value comes from, in the last sentence of its doc comment: `Physical:` a source,
//! `Statistical:` a derivation, `Tuned:` or `Chosen:` a choice, `Resolution:` a grid or tolerance of the computation.

pub mod base;
pub mod curve_axes;
pub mod grid;
pub mod intervals;
pub mod moments;
pub mod trial;
pub mod wall;
pub mod windows;
