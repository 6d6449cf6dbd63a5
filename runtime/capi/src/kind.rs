//! Kinds of handles: the name a fault gives them and the mark in their memory.

/// Which handle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Basis,
    Workspace,
    Controls,
    Pins,
    Batch,
    Decoder,
    Surface,
}

impl Kind {
    /// Mark of a handle that was closed.
    pub(crate) const CLOSED: u32 = u32::from_le_bytes(*b"Snw0");

    const ALL: [Self; 7] = [
        Self::Basis,
        Self::Workspace,
        Self::Controls,
        Self::Pins,
        Self::Batch,
        Self::Decoder,
        Self::Surface,
    ];

    /// The mark of an open handle.
    pub(crate) const fn tag(self) -> u32 {
        u32::from_le_bytes(*match self {
            Self::Basis => b"SnwB",
            Self::Workspace => b"SnwW",
            Self::Controls => b"SnwC",
            Self::Pins => b"SnwP",
            Self::Batch => b"SnwN",
            Self::Decoder => b"SnwD",
            Self::Surface => b"SnwS",
        })
    }

    /// What messages call it: the name of its argument, too.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Basis => "basis",
            Self::Workspace => "workspace",
            Self::Controls => "controls",
            Self::Pins => "pins",
            Self::Batch => "batch",
            Self::Decoder => "decoder",
            Self::Surface => "surface",
        }
    }

    /// The kind of a mark.
    pub(crate) fn of(tag: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.tag() == tag)
    }
}
