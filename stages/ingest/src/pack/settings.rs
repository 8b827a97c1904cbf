//! Settings of the packer of samples.

/// Settings of the packer of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PackSettings {
    /// Low-pass on positions before they are differentiated \[Hz\].
    pub velocity_cutoff_hz: f64,
    /// Older commands and efforts of another twin do not belong to a sample \[ns\].
    pub max_age_ns: i64,
    /// Longest wait of a sample for the command and the other twin's effort of its instant, in time of
    /// reception \[ns\].
    pub wait_ns: i64,
    /// Whether commands are to be waited for.
    pub expects_command: bool,
    /// Whether another twin's efforts are to be waited for.
    pub expects_reference: bool,
}
