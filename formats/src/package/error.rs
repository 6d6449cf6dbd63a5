//! Why a package is refused: one variant for every rule, without heap. Returned by opening, and by writing, which opens
//! what it wrote.

use core::fmt;

use super::PackageKind;

/// Why a package does not open. `field` is a field of the payload as `FORMAT.md` names it; `index` counts its elements.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum OpenError {
    /// Fewer bytes than a header.
    TooShort {
        /// Bytes given.
        actual: usize,
    },
    /// The first eight bytes are not a package's.
    WrongMagic,
    /// The header's checksum does not fit.
    HeaderCorrupt,
    /// Written by a version this reader does not know.
    UnsupportedVersion {
        /// Version of the package.
        found: u16,
        /// Oldest version that this reader opens.
        first: u16,
        /// Newest version that this reader opens.
        latest: u16,
    },
    /// A reserved byte of the header is not zero.
    ReservedNotZero,
    /// The header names a kind that does not exist.
    UnknownKind {
        /// Code of the kind.
        found: u8,
    },
    /// A package of the other kind.
    WrongKind {
        /// What the caller opens.
        expected: PackageKind,
        /// What the package is.
        found: PackageKind,
    },
    /// The file ends early.
    Truncated {
        /// Bytes that the header promises.
        expected: u64,
        /// Bytes given.
        actual: u64,
    },
    /// Bytes follow the payload.
    TrailingBytes {
        /// Bytes that the header promises.
        expected: u64,
        /// Bytes given.
        actual: u64,
    },
    /// The bytes do not start at a multiple of the alignment.
    Misaligned {
        /// The alignment, in bytes.
        required: usize,
    },
    /// The content id in the header is not the payload's.
    ContentIdMismatch,
    /// The payload is not an archive of its kind: a pointer, a length or a string is wrong.
    Malformed,
    /// A number is NaN or infinite.
    NotFinite {
        /// Field.
        field: &'static str,
        /// Element.
        index: usize,
    },
    /// A number lies outside its range.
    OutOfRange {
        /// Field.
        field: &'static str,
        /// Element.
        index: usize,
        /// The number.
        value: f32,
        /// Least allowed.
        least: f32,
        /// Greatest allowed.
        greatest: f32,
    },
    /// A number that must be above zero is not.
    NotPositive {
        /// Field.
        field: &'static str,
        /// Element.
        index: usize,
    },
    /// A pivot of the factor is not above zero.
    PivotNotPositive {
        /// Column.
        index: usize,
    },
    /// An index points past the end of what it indexes.
    IndexOutOfRange {
        /// Field.
        field: &'static str,
        /// Element.
        index: usize,
        /// The index found.
        value: u32,
        /// It must be less.
        limit: u32,
    },
    /// Two counts that must agree do not.
    CountMismatch {
        /// Field.
        field: &'static str,
        /// Count that follows from the rest of the package.
        expected: u64,
        /// Count found.
        actual: u64,
    },
    /// A field has fewer elements than make sense.
    TooFew {
        /// Field.
        field: &'static str,
        /// Least count.
        least: usize,
        /// Count found.
        actual: usize,
    },
    /// A field has more elements than the format allows.
    TooMany {
        /// Field.
        field: &'static str,
        /// Greatest count.
        limit: usize,
        /// Count found.
        actual: usize,
    },
    /// An element is not greater than the one before it.
    NotAscending {
        /// Field.
        field: &'static str,
        /// Element.
        index: usize,
    },
    /// A block's parent is missing, or comes after it, or is not of the previous level.
    ParentAfterChild {
        /// Block.
        block: usize,
    },
    /// A component names another block than the one that lists it, or a block's first component or vertex is not the
    /// one after the previous block's last.
    NotContiguous {
        /// Field.
        field: &'static str,
        /// Element.
        index: usize,
    },
    /// Two index lists are not each other's inverse.
    NotAPermutation {
        /// Field.
        field: &'static str,
        /// Element.
        index: usize,
    },
    /// An edge is missing in the other direction, or weighs something else there.
    NotSymmetric {
        /// Field.
        field: &'static str,
        /// Element.
        index: usize,
    },
    /// The skin weights of a vertex do not sum to one.
    SkinWeightSum {
        /// Slot of the vertex.
        slot: usize,
        /// Their sum, in units of 1 / 65535.
        sum: u32,
    },
    /// Indices are wider or narrower than the count of what they number asks for.
    IndexWidth {
        /// Field.
        field: &'static str,
    },
    /// A baked package without a tier plays nothing.
    NoTier,
    /// A bit beyond the last vertex is set.
    BitmapTail {
        /// Component.
        component: usize,
    },
    /// A control cannot be at rest: its range leaves out zero.
    RangeWithoutZero {
        /// Component.
        component: usize,
    },
    /// A name is empty, too long, or has a control character.
    NameInvalid {
        /// Field.
        field: &'static str,
        /// Element.
        index: usize,
    },
    /// Two components have one name.
    NameDuplicate {
        /// The first of them.
        first: usize,
        /// The second of them.
        second: usize,
    },
}

impl core::error::Error for OpenError {}

impl fmt::Display for OpenError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooShort { actual } => {
                write!(
                    out,
                    "not a Sinew package: {actual} bytes, less than a header; is the copy complete?"
                )
            }
            Self::WrongMagic => write!(
                out,
                "not a Sinew package, or one that went through a transfer in text mode"
            ),
            Self::HeaderCorrupt => write!(out, "the package's header is damaged; copy the file again"),
            Self::UnsupportedVersion { found, first, latest } => write!(
                out,
                "the package has format version {found} and this program opens {first} to {latest}; \
                 use the program that wrote it, or train again"
            ),
            Self::ReservedNotZero => write!(out, "reserved bytes of the package's header are in use"),
            Self::UnknownKind { found } => write!(out, "the package is of unknown kind {found}"),
            Self::WrongKind {
                expected: PackageKind::Baked,
                found,
            } => {
                write!(
                    out,
                    "the package is {found}, and a baked one is needed; run `sinew bake` on it"
                )
            }
            Self::WrongKind { expected, found } => {
                write!(
                    out,
                    "the package is {found}, and a {expected} one is needed; use the file it was baked from"
                )
            }
            Self::Truncated { expected, actual } => {
                write!(
                    out,
                    "the package is cut off: {actual} of {expected} bytes; copy the file again"
                )
            }
            Self::TrailingBytes { expected, actual } => {
                write!(
                    out,
                    "the package should end after {expected} bytes and has {actual}; copy the file again"
                )
            }
            Self::Misaligned { required } => {
                write!(
                    out,
                    "the package must start at a multiple of {required} bytes in memory"
                )
            }
            Self::ContentIdMismatch => write!(
                out,
                "the package is damaged: its content is not what its header names; copy the file again"
            ),
            Self::Malformed => write!(out, "the package's payload is not a valid archive"),
            Self::NotFinite { field, index } => write!(out, "`{field}` {index} is not a finite number"),
            Self::OutOfRange {
                field,
                index,
                value,
                least,
                greatest,
            } => {
                write!(out, "`{field}` {index} is {value}, outside {least} to {greatest}")
            }
            Self::NotPositive { field, index } => write!(out, "`{field}` {index} must be above zero"),
            Self::PivotNotPositive { index } => write!(out, "pivot {index} of the factor must be above zero"),
            Self::IndexOutOfRange {
                field,
                index,
                value,
                limit,
            } => {
                write!(out, "`{field}` {index} is {value}, and must be less than {limit}")
            }
            Self::CountMismatch {
                field,
                expected,
                actual,
            } => {
                write!(
                    out,
                    "`{field}` has {actual} elements, and {expected} follow from the rest of the package"
                )
            }
            Self::TooFew { field, least, actual } => {
                write!(out, "`{field}` has {actual} elements, and needs at least {least}")
            }
            Self::TooMany { field, limit, actual } => {
                write!(out, "`{field}` has {actual} elements, and the format allows {limit}")
            }
            Self::NotAscending { field, index } => write!(out, "`{field}` {index} is not greater than the one before"),
            Self::ParentAfterChild { block } => write!(
                out,
                "block {block} must hang on a component of the previous level that comes before it (the root on none)"
            ),
            Self::NotContiguous { field, index } => {
                write!(out, "`{field}` {index} does not follow on from the one before")
            }
            Self::NotAPermutation { field, index } => write!(out, "`{field}` {index} breaks the permutation"),
            Self::NotSymmetric { field, index } => {
                write!(
                    out,
                    "`{field}` {index} differs from the same edge in the other direction"
                )
            }
            Self::SkinWeightSum { slot, sum } => {
                write!(out, "the skin weights of slot {slot} sum to {sum} and not to 65535")
            }
            Self::IndexWidth { field } => write!(
                out,
                "`{field}` must be 16 bits wide for at most 65536 things, and 32 bits for more"
            ),
            Self::NoTier => write!(out, "the package has no tier to play"),
            Self::BitmapTail { component } => {
                write!(
                    out,
                    "the support of component {component} has bits beyond the last vertex"
                )
            }
            Self::RangeWithoutZero { component } => {
                write!(
                    out,
                    "the range of component {component} leaves out zero, so its control cannot rest"
                )
            }
            Self::NameInvalid { field, index } => {
                write!(out, "`{field}` {index} is empty, too long or has control characters")
            }
            Self::NameDuplicate { first, second } => {
                write!(out, "components {first} and {second} have the same name")
            }
        }
    }
}
