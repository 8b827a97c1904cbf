//! Step 5, select: which effects, together, explain what the twin leaves.
//!
//! In: the data of step 2 and the library of hypotheses. Out: an [`explanation::Explanation`], a fit with a penalty for
//! each of its effects. Stepwise selection (Hastie, Tibshirani and Friedman, *The Elements of Statistical Learning*,
//! 2009, section 3.3): `forward` adds the effect with the most evidence, `prune` takes out what is no longer needed,
//! `exchange` tries every rival in the place of each effect, and `nested` prefers the simpler of two nested effects.
//! Evidence is the gain of log-likelihood less the Bayesian information criterion's penalty (Schwarz, "Estimating the
//! Dimension of a Model", *Annals of Statistics* 6, 1978) and less the logarithm of the number of hypotheses.
//! Shape parameters are searched on a grid with the factors solved for at each point, as in variable projection (Golub
//! and Pereyra, *SIAM Journal on Numerical Analysis* 10, 1973). What does not predict recordings that are left out of
//! the fit is not taken (`cross_validation`; the book's section 7.10). Where no effect fits, a curve (`curves`) or a
//! free body (`free_body`) describes what is left.

pub mod candidates;
pub mod cross_validation;
pub mod curve_shapes;
pub mod curves;
pub mod evidence;
pub mod exchange;
pub mod explanation;
pub mod forward;
pub mod free_body;
pub mod nested;
pub mod parallel;
pub mod plausible;
pub mod propose;
pub mod prune;
pub mod search;
pub mod split_push;
pub mod trial;
pub mod wall;
pub mod windows;
