//! How binary USD packs bytes and whole numbers: LZ4 blocks, and differences of one to four bytes (or two to eight) behind codes of two
//! bits. Damage gives none; no memory is taken that the bytes cannot fill.

/// LZ4 makes nothing smaller than this.
const SHRINKS_MAX: usize = 255;
/// Whole numbers that one unpacked byte can stand for: four codes that all mean the common difference.
const NUMBERS_A_BYTE_MAX: u64 = 4;

/// Unpacks at most `size_max` bytes.
pub(super) fn unpack(packed: &[u8], size_max: u64) -> Option<Vec<u8>> {
    let (&chunk_count, mut rest) = packed.split_first()?;
    let reachable = packed.len().checked_mul(SHRINKS_MAX)?.checked_add(64)?;
    let mut out = vec![0; usize::try_from(size_max).ok()?.min(reachable)];
    if chunk_count == 0 {
        let size = lz4_flex::block::decompress_into(rest, &mut out).ok()?;
        out.truncate(size);
        return Some(out);
    }
    let mut filled = 0;
    for _ in 0..chunk_count {
        let (size, behind) = rest.split_first_chunk::<4>()?;
        let size = usize::try_from(i32::from_le_bytes(*size)).ok()?;
        let (chunk, behind) = behind.split_at_checked(size)?;
        filled += lz4_flex::block::decompress_into(chunk, &mut out[filled..]).ok()?;
        rest = behind;
    }
    out.truncate(filled);
    Some(out)
}

/// Unpacks `count` whole numbers of 32 bits, or of 64.
pub(super) fn integers(packed: &[u8], count: u64, is_wide: bool) -> Option<Vec<i64>> {
    if count > (packed.len() as u64).saturating_mul(SHRINKS_MAX as u64 * NUMBERS_A_BYTE_MAX) {
        return None;
    }
    let width = if is_wide { 8 } else { 4 };
    let code_bytes = count.div_ceil(4);
    let encoded = unpack(packed, code_bytes + (count + 1).saturating_mul(width))?;
    let (common, rest) = encoded.split_at_checked(width as usize)?;
    let common = signed(common);
    let (codes, mut differences) = rest.split_at_checked(code_bytes as usize)?;
    let mut numbers = Vec::with_capacity(count as usize);
    let mut sum = 0i64;
    for i in 0..count as usize {
        let code = codes[i / 4] >> (2 * (i % 4)) & 3;
        let difference = if code == 0 {
            common
        } else {
            let size = (usize::from(is_wide) + 1) << (code - 1);
            let (own, behind) = differences.split_at_checked(size)?;
            differences = behind;
            signed(own)
        };
        sum = sum.wrapping_add(difference);
        numbers.push(if is_wide { sum } else { i64::from(sum as i32) });
    }
    Some(numbers)
}

/// A whole number of one, two, four or eight bytes.
fn signed(bytes: &[u8]) -> i64 {
    let fill = if bytes.last().is_some_and(|byte| byte & 0x80 != 0) {
        0xff
    } else {
        0
    };
    let mut wide = [fill; 8];
    wide[..bytes.len()].copy_from_slice(bytes);
    i64::from_le_bytes(wide)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An LZ4 block that packs nothing.
    fn literal(bytes: &[u8]) -> Vec<u8> {
        assert!(bytes.len() < 15);
        [&[0, (bytes.len() as u8) << 4], bytes].concat()
    }

    #[test]
    fn differences_of_all_sizes_add_up() {
        // The common difference 1, then codes 0, 1, 2, 3: +1, -3, +300, -70000.
        let mut encoded = 1i32.to_le_bytes().to_vec();
        encoded.push(0b11_10_01_00);
        encoded.extend((-3i8).to_le_bytes());
        encoded.extend(300i16.to_le_bytes());
        encoded.extend((-70_000i32).to_le_bytes());
        assert_eq!(integers(&literal(&encoded), 4, false), Some(vec![1, -2, 298, -69_702]));
        assert_eq!(integers(&literal(&encoded[..8]), 4, false), None);
        assert_eq!(integers(&literal(&encoded), u64::MAX, false), None);
        let wide = [&2i64.to_le_bytes()[..], &[0b0100], &(-1i16).to_le_bytes()].concat();
        assert_eq!(integers(&literal(&wide), 2, true), Some(vec![2, 1]));
        assert_eq!(integers(&[], 1, false), None);
    }

    #[test]
    fn chunks_follow_one_another() {
        let chunk = |bytes: &[u8]| {
            let block = literal(bytes)[1..].to_vec();
            [&(block.len() as i32).to_le_bytes()[..], &block].concat()
        };
        let packed = [&[2][..], &chunk(b"ab"), &chunk(b"cde")].concat();
        assert_eq!(unpack(&packed, 5).as_deref(), Some(&b"abcde"[..]));
        assert_eq!(unpack(&packed, 4), None);
        assert_eq!(unpack(&packed[..6], 5), None);
    }
}
