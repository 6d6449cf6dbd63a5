//! Triangles of a compact package: corners as u16 where every vertex has such a number, which halves them.

#[cfg(feature = "alloc")]
use alloc::vec::Vec;

use rkyv::{
    ArchiveUnsized, Place, SerializeUnsized,
    boxed::{ArchivedBox, BoxResolver},
    munge::munge,
    primitive::ArchivedUsize,
    rancor::Fallible,
    ser::{Writer, WriterExt},
    tuple::ArchivedTuple2,
    with::{ArchiveWith, SerializeWith},
};

/// Archives triangles as two slices: corners as u32, and corners as u16. All are in the second where all fit.
#[derive(Debug)]
pub struct AsShortAsFit;

/// Triangles as they lie in a compact package. Shape: `[F]`; corners are vertices in source order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Faces<'a> {
    /// These first; a writer leaves one of the two empty.
    pub(super) wide: &'a [[u32; 3]],
    pub(super) short: &'a [[u16; 3]],
}

impl<'a> Faces<'a> {
    /// F.
    pub fn len(&self) -> usize {
        self.wide.len() + self.short.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All triangles in order.
    pub fn iter(&self) -> impl Iterator<Item = [u32; 3]> + Clone + use<'a> {
        let short = self.short.iter().map(|corners| corners.map(u32::from));
        self.wide.iter().copied().chain(short)
    }

    /// The same, owned.
    #[cfg(feature = "alloc")]
    pub fn to_vec(&self) -> Vec<[u32; 3]> {
        self.iter().collect()
    }
}

fn are_short(faces: &[[u32; 3]]) -> bool {
    faces.as_flattened().iter().all(|&vertex| vertex <= u32::from(u16::MAX))
}

fn wide(faces: &[[u32; 3]]) -> &[[u32; 3]] {
    if are_short(faces) { &[] } else { faces }
}

impl ArchiveWith<&[[u32; 3]]> for AsShortAsFit {
    type Archived = ArchivedTuple2<
        ArchivedBox<<[[u32; 3]] as ArchiveUnsized>::Archived>,
        ArchivedBox<<[[u16; 3]] as ArchiveUnsized>::Archived>,
    >;
    type Resolver = (BoxResolver, BoxResolver);

    fn resolve_with(field: &&[[u32; 3]], resolver: Self::Resolver, out: Place<Self::Archived>) {
        munge!(let ArchivedTuple2(wide_out, short_out) = out);
        let wide = wide(field);
        ArchivedBox::resolve_from_ref(wide, resolver.0, wide_out);
        let short_count = field.len() - wide.len();
        // The format's limits keep the count below 2^32; what is written is opened again.
        let short_count = ArchivedUsize::from_native(short_count as u32);
        ArchivedBox::resolve_from_raw_parts(resolver.1, short_count, short_out);
    }
}

impl<S: Fallible + Writer + ?Sized> SerializeWith<&[[u32; 3]], S> for AsShortAsFit
where
    [[u32; 3]]: SerializeUnsized<S>,
{
    fn serialize_with(field: &&[[u32; 3]], serializer: &mut S) -> Result<Self::Resolver, S::Error> {
        let wide_at = ArchivedBox::serialize_from_ref(wide(field), serializer)?;
        let short_at = serializer.align_for::<u16>()?;
        if are_short(field) {
            for vertex in field.as_flattened() {
                serializer.write(&(*vertex as u16).to_le_bytes())?;
            }
        }
        Ok((wide_at, BoxResolver::from_pos(short_at)))
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::super::fixture::tiny_compact;
    use super::super::{CompactView, OpenError, WriteError, write_compact};

    #[test]
    fn corners_are_short_where_all_fit() {
        let mut tiny = tiny_compact();
        let faces = tiny.faces.clone();
        let short = write_compact(&tiny.basis()).unwrap();
        let view = CompactView::open(&short).unwrap();
        assert_eq!((view.faces().wide.len(), view.faces().short.len()), (0, faces.len()));
        assert_eq!(view.faces().to_vec(), faces);

        // Vertices beyond u16, each on a place of its own.
        let count = 65_537 + tiny.rest_positions.len();
        tiny.rest_positions.resize_with(count, || [0.0, 1.0, 2.0]);
        let words = count.div_ceil(32);
        let own_words = tiny.support_bits.len() / tiny.components.len();
        tiny.support_bits = tiny
            .support_bits
            .chunks(own_words)
            .flat_map(|row| row.iter().copied().chain(core::iter::repeat_n(0, words - own_words)))
            .collect();
        tiny.faces.push([0, 1, 65_536]);
        tiny.render = Default::default();
        let wide = write_compact(&tiny.basis()).unwrap();
        let view = CompactView::open(&wide).unwrap();
        assert_eq!(
            (view.faces().wide.len(), view.faces().short.len()),
            (faces.len() + 1, 0)
        );
        assert_eq!(view.faces().to_vec(), tiny.faces);
        assert_eq!(view.faces().len(), tiny.faces.len());

        tiny.faces[0][1] = count as u32;
        assert!(matches!(
            write_compact(&tiny.basis()),
            Err(WriteError::Refused(OpenError::IndexOutOfRange { field: "faces", .. }))
        ));
    }
}
