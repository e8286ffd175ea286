//! How far a forward pass goes.

/// How far a forward pass goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Every garment by itself.
    Single,
    /// Every garment by itself, then all of them against each other.
    Layered,
}
