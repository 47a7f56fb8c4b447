//! Purposes of the runs that a law asks for: learning, or measuring something about the plant.

/// Purpose of a run.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// The error of the run counts, and is learned from.
    #[default]
    Learning,
    /// The run measures the gradient; its error may be larger.
    Probing,
    /// The run measures how far to follow the gradient; its error may be larger.
    Searching,
}

impl Purpose {
    /// Returns the name, as in records and in Python.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Learning => "learning",
            Self::Probing => "probing",
            Self::Searching => "searching",
        }
    }
}
