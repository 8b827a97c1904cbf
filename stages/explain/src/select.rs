//! Step 5, select: finds the effects that together explain the twin's residual.
//!
//! Input: the data of step 2 and the library of hypotheses. Output: an [`explanation::Explanation`], a fit with a
//! penalty for each of its effects.
//!
//! The method is stepwise selection (Hastie, Tibshirani and Friedman, *The Elements of Statistical Learning*, 2009,
//! section 3.3):
//!
//! - `forward` adds the effect with the most evidence;
//! - `by_recording` adds what differs from one recording to the next in all of them at once;
//! - `prune` removes effects that are no longer needed;
//! - `exchange` tries every rival in the place of each effect;
//! - `one_zero` tries one shifted joint zero in the place of several bodies;
//! - `nested` prefers the simpler of two nested effects;
//! - `cross_validation` rejects effects that do not predict recordings left out of the fit (the book's section 7.10);
//! - `curves` and `free_body` describe the residual where no effect of the library fits;
//! - `drifts` names friction that is a straight line over the session;
//! - `carried` tells what carries over from one recording to the next from noise, however slow that is.
//!
//! Evidence is the gain of log-likelihood minus the penalty of the Bayesian information criterion (Schwarz, "Estimating
//! the Dimension of a Model", *Annals of Statistics* 6, 1978) and minus the logarithm of the number of hypotheses.
//! Shape parameters are searched on a grid. At each grid point the factors are solved for, as in variable projection
//! (Golub and Pereyra, *SIAM Journal on Numerical Analysis* 10, 1973).
//!
//! Each constant says where its value comes from, in the last sentence of its doc comment: `Physical:` a source,
//! `Statistical:` a derivation, `Tuned:` a choice by trial, `Resolution:` a grid or tolerance of the computation. Where
//! no seeds are recorded, the sets of docs/proof.md may have been in view; no value was swept. `tests/proof/vary.py`
//! measures how much the answers depend on those marked `Tuned:`.

pub mod by_recording;
pub mod candidates;
pub mod carried;
pub mod closed_waves;
pub mod cross_validation;
pub mod curve_axes;
pub mod curve_shapes;
pub mod curves;
pub mod drifts;
pub mod evidence;
pub mod exchange;
pub mod explanation;
pub mod forward;
pub mod free_body;
pub mod grid;
pub mod intervals;
pub mod listed;
pub mod moments;
pub mod nested;
pub mod one_zero;
pub mod parallel;
pub mod plausible;
pub mod propose;
pub mod prune;
mod restart;
pub mod search;
pub mod split_push;
pub mod spots;
pub mod trial;
pub mod wall;
pub mod windows;
