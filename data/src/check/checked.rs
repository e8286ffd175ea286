//! What the check of one file comes to, whatever kind of file it is.

/// Measurements of a file that could be read, and what was found out about it.
pub(super) struct CheckedFile<T> {
    pub measured: T,
    pub warnings: Vec<String>,
    /// Why training would refuse it, if so.
    pub unusable: Option<String>,
}
