//! Indices as short as fit: u16 where they number at most 65,536 things, else u32. The count of the things decides, not the
//! indices, so all indices of one mesh have one width and the frame path is compiled for either.

#[cfg(feature = "alloc")]
use alloc::vec::Vec;

use rkyv::{
    Archive, ArchiveUnsized, Place, Serialize, SerializeUnsized,
    boxed::{ArchivedBox, BoxResolver},
    munge::munge,
    primitive::ArchivedUsize,
    rancor::Fallible,
    ser::{Writer, WriterExt},
    tuple::ArchivedTuple2,
};

use super::archive::native;

/// Most things that short indices number.
pub const SHORT_COUNT: usize = 1 << 16;

/// Indices to be written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Indices<'a> {
    /// Each below `count`.
    pub values: &'a [u32],
    /// How many things they number.
    pub count: usize,
}

impl<'a> Indices<'a> {
    /// Indices of `count` things.
    pub fn of(count: usize, values: &'a [u32]) -> Self {
        Self { values, count }
    }

    /// Whether they are written as u16. What does not fit is written wide, and opening refuses it by its value.
    fn are_short(&self) -> bool {
        self.count <= SHORT_COUNT && self.values.iter().all(|&value| value <= u32::from(u16::MAX))
    }

    fn wide(&self) -> &'a [u32] {
        if self.are_short() { &[] } else { self.values }
    }
}

/// Indices as they lie in a package.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "both variants are what the type says")]
pub enum IndexSlice<'a> {
    Short(&'a [u16]),
    Wide(&'a [u32]),
}

impl<'a> IndexSlice<'a> {
    /// How many indices there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Short(values) => values.len(),
            Self::Wide(values) => values.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Index `i`. Panics past the end, like a slice.
    pub fn at(&self, i: usize) -> u32 {
        match self {
            Self::Short(values) => u32::from(values[i]),
            Self::Wide(values) => values[i],
        }
    }

    /// All of them in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = u32> + DoubleEndedIterator + Clone + use<'a> {
        let slice = *self;
        (0..slice.len()).map(move |i| slice.at(i))
    }

    /// The same, owned.
    #[cfg(feature = "alloc")]
    pub fn to_vec(&self) -> Vec<u32> {
        self.iter().collect()
    }
}

/// A width of indices, for code that is compiled for both.
pub trait Index: bytemuck::Pod + Send + Sync + core::fmt::Debug {
    /// As an index of slices.
    fn at(self) -> usize;
    /// Indices of this width; none where they have the other, which an opened package has for empty ones alone.
    fn of(slice: IndexSlice<'_>) -> &[Self];
}

impl Index for u16 {
    fn at(self) -> usize {
        usize::from(self)
    }
    fn of(slice: IndexSlice<'_>) -> &[Self] {
        match slice {
            IndexSlice::Short(values) => values,
            IndexSlice::Wide(_) => &[],
        }
    }
}

impl Index for u32 {
    fn at(self) -> usize {
        self as usize
    }
    fn of(slice: IndexSlice<'_>) -> &[Self] {
        match slice {
            IndexSlice::Short(_) => &[],
            IndexSlice::Wide(values) => values,
        }
    }
}

/// Two slices, wide ones and short ones; one of them is empty.
pub type ArchivedIndices =
    ArchivedTuple2<ArchivedBox<<[u32] as ArchiveUnsized>::Archived>, ArchivedBox<<[u16] as ArchiveUnsized>::Archived>>;

/// Where they lie; none where both slices hold some, so that no rule about a count lets that pass.
pub(super) fn slice(archived: &ArchivedIndices) -> IndexSlice<'_> {
    match (archived.0.is_empty(), archived.1.is_empty()) {
        (true, _) => IndexSlice::Short(native(&archived.1)),
        (false, true) => IndexSlice::Wide(native(&archived.0)),
        (false, false) => IndexSlice::Short(&[]),
    }
}

impl Archive for Indices<'_> {
    type Archived = ArchivedIndices;
    type Resolver = (BoxResolver, BoxResolver);

    fn resolve(&self, resolver: Self::Resolver, out: Place<Self::Archived>) {
        munge!(let ArchivedTuple2(wide_out, short_out) = out);
        let wide = self.wide();
        ArchivedBox::resolve_from_ref(wide, resolver.0, wide_out);
        let short_count = self.values.len() - wide.len();
        // The format's limits keep the count below 2^32; what is written is opened again.
        let short_count = ArchivedUsize::from_native(short_count as u32);
        ArchivedBox::resolve_from_raw_parts(resolver.1, short_count, short_out);
    }
}

impl<S: Fallible + Writer + ?Sized> Serialize<S> for Indices<'_>
where
    [u32]: SerializeUnsized<S>,
{
    fn serialize(&self, serializer: &mut S) -> Result<Self::Resolver, S::Error> {
        let wide_at = ArchivedBox::serialize_from_ref(self.wide(), serializer)?;
        let short_at = serializer.align_for::<u16>()?;
        if self.are_short() {
            for value in self.values {
                serializer.write(&(*value as u16).to_le_bytes())?;
            }
        }
        Ok((wide_at, BoxResolver::from_pos(short_at)))
    }
}
