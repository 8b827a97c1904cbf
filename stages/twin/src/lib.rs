//! What the effort should have been: expected effort and residual.
