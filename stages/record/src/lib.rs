//! What stays: the MCAP archive and the Rerun picture.
