//! Contacts and collisions from the residual, one file per detector.
