//! What both kinds of package have in common as bytes: a proved payload, and archived numbers read as native ones.

use rkyv::boxed::ArchivedBox;

use super::{Header, OpenError, PackageKind};

#[cfg(target_endian = "big")]
compile_error!("packages are little endian and read in place: Sinew does not run on big-endian targets");

/// The payload of a package that should be of `kind`: its length, place, content id and kind are proved, its content is not.
pub(super) fn payload(bytes: &[u8], kind: PackageKind) -> Result<(Header, &[u8]), OpenError> {
    let header = Header::read(bytes)?;
    let payload = header.payload(bytes)?;
    if header.kind != kind {
        return Err(OpenError::WrongKind {
            expected: kind,
            found: header.kind,
        });
    }
    Ok((header, payload))
}

/// Reads archived numbers as native ones. Both are plain data of one size and alignment, so the cast cannot fail.
pub(super) fn native<A: bytemuck::NoUninit, N: bytemuck::AnyBitPattern>(archived: &ArchivedBox<[A]>) -> &[N] {
    bytemuck::cast_slice(archived.get())
}
