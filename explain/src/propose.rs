//! Step 5, propose: where the search for an explanation begins.
//!
//! In: the data of step 2 and a fit. Out: the shapes of each effect that are tried (`grid`), the times at which
//! something may have begun or ended (`times`), the walls that contacts suggest (`wall`), and what a curve may be a
//! function of (`curve_axes`). Nothing here compares effects: that is done by `inference`.
//!
//! Each constant says where its value comes from, in the last sentence of its doc comment: `Physical:` a source,
//! `Statistical:` or `Derived:` a derivation, `Tuned:` or `Chosen:` a choice, `Resolution:` a grid or tolerance of the
//! computation, `Layout:` the look of a page.

pub mod curve_axes;
pub mod grid;
mod intervals;
mod running_sums;
pub mod times;
pub mod wall;
