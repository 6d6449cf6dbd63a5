//! Unpacks buffer views that meshoptimizer packed: `EXT_meshopt_compression` and `KHR_meshopt_compression`, appendix A (bitstream)
//! and B (filters). Bytes that do not follow it are refused; no memory is taken that they cannot fill.

use super::document::Compressed;

/// A stream packs nothing into fewer bytes than this share: 256 elements of which no byte changes take a header of a few bits.
const SHRINKS_MAX: u64 = 4096;
/// Elements of a group.
const GROUP: usize = 16;
/// Bytes of a block of elements at most, and elements of it.
const BLOCK_BYTES_MAX: usize = 8192;
const BLOCK_ELEMENTS_MAX: usize = 256;

/// The bytes of a view; what is wrong with its packing as the error.
pub(super) fn unpack(compressed: &Compressed, packed: &[u8]) -> Result<Vec<u8>, String> {
    let stride = compressed.byte_stride;
    let size = compressed
        .count
        .checked_mul(stride)
        .filter(|&size| size / SHRINKS_MAX <= packed.len() as u64);
    let Some(size) = size.and_then(|size| usize::try_from(size).ok()) else {
        return Err(format!(
            "{} elements of {stride} bytes in {} packed bytes",
            compressed.count,
            packed.len()
        ));
    };
    let (count, stride) = (compressed.count as usize, stride as usize);
    match compressed.mode.as_str() {
        "ATTRIBUTES" if stride > 0 && stride.is_multiple_of(4) && stride <= 256 => {
            let mut bytes = attributes(packed, count, stride).ok_or("a damaged stream of attributes")?;
            filter(&compressed.filter, &mut bytes, stride)?;
            debug_assert_eq!(bytes.len(), size);
            Ok(bytes)
        }
        "TRIANGLES" if matches!(stride, 2 | 4) && count.is_multiple_of(3) => {
            let indices = triangles(packed, count / 3).ok_or("a damaged stream of triangles")?;
            Ok(indices_as_bytes(&indices, stride))
        }
        "INDICES" if matches!(stride, 2 | 4) => {
            let indices = indices(packed, count).ok_or("a damaged stream of indices")?;
            Ok(indices_as_bytes(&indices, stride))
        }
        mode => Err(format!("the mode `{mode}` with elements of {stride} bytes")),
    }
}

fn indices_as_bytes(indices: &[u32], stride: usize) -> Vec<u8> {
    indices
        .iter()
        .flat_map(|index| index.to_le_bytes().into_iter().take(stride))
        .collect()
}

/// Takes bytes off the front.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|taken| taken[0])
    }

    /// LEB128, of five bytes at most.
    fn number(&mut self) -> Option<u32> {
        let mut value = 0u32;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }
}

/// Elements byte by byte, as differences to the element before.
fn attributes(packed: &[u8], count: usize, stride: usize) -> Option<Vec<u8>> {
    let (&header, rest) = packed.split_first()?;
    let version = match header {
        0xa0 => 0,
        0xa1 => 1,
        _ => return None,
    };
    // Behind the blocks: padding, the element before the first, how channels of four bytes differ.
    let mode_count = if version == 1 { stride / 4 } else { 0 };
    let tail_bytes = (stride + mode_count).max(if version == 1 { 24 } else { 32 });
    let (blocks, tail) = rest.split_at_checked(rest.len().checked_sub(tail_bytes)?)?;
    let tail = &tail[tail.len() - stride - mode_count..];
    let (mut last, modes) = (tail[..stride].to_vec(), &tail[stride..]);
    let mut reader = Reader(blocks);
    let block_elements = ((BLOCK_BYTES_MAX / stride) & !(GROUP - 1)).min(BLOCK_ELEMENTS_MAX);
    let mut out = Vec::new();
    let mut left = count;
    let mut deltas = vec![0u8; block_elements * stride];
    while left > 0 {
        let elements = left.min(block_elements);
        left -= elements;
        let controls: Vec<u8> = if version == 1 {
            reader.take(stride / 4)?.to_vec()
        } else {
            Vec::new()
        };
        for k in 0..stride {
            let control = controls.get(k / 4).map(|byte| byte >> (k % 4 * 2) & 3);
            let deltas = &mut deltas[k * block_elements..][..block_elements];
            channel(&mut reader, control, elements, deltas)?;
        }
        for i in 0..elements {
            for first in (0..stride).step_by(4) {
                let delta = core::array::from_fn(|k| deltas[(first + k) * block_elements + i]);
                let before = [last[first], last[first + 1], last[first + 2], last[first + 3]];
                let mode = modes.get(first / 4).copied().unwrap_or(0);
                last[first..first + 4].copy_from_slice(&undelta(mode, before, delta)?);
            }
            out.extend_from_slice(&last);
        }
    }
    reader.0.is_empty().then_some(out)
}

/// Differences of one byte of the elements of a block, in groups.
fn channel(reader: &mut Reader<'_>, control: Option<u8>, elements: usize, out: &mut [u8]) -> Option<()> {
    // Bits that a group's differences take, by its two header bits.
    let bits = match control {
        None => [0, 2, 4, 8],
        Some(0) => [0, 1, 2, 4],
        Some(1) => [1, 2, 4, 8],
        Some(2) => {
            out[..elements].fill(0);
            return Some(());
        }
        Some(_) => {
            out[..elements].copy_from_slice(reader.take(elements)?);
            return Some(());
        }
    };
    let group_count = elements.div_ceil(GROUP);
    let header = reader.take(group_count.div_ceil(4))?;
    for group in 0..group_count {
        let bits = bits[usize::from(header[group / 4] >> (group % 4 * 2) & 3)];
        let out = &mut out[group * GROUP..][..GROUP];
        match bits {
            0 => out.fill(0),
            8 => out.copy_from_slice(reader.take(GROUP)?),
            bits => {
                let packed = reader.take(GROUP * bits / 8)?;
                let largest = (1u8 << bits) - 1;
                for (i, place) in out.iter_mut().enumerate() {
                    let bit = i * bits % 8;
                    // Bits run up the byte where they are single, else down.
                    let shift = if bits == 1 { bit } else { 8 - bits - bit };
                    let value = packed[i * bits / 8] >> shift & largest;
                    *place = if value == largest { reader.byte()? } else { value };
                }
            }
        }
    }
    Some(())
}

/// Four bytes of an element from those of the one before.
fn undelta(mode: u8, before: [u8; 4], delta: [u8; 4]) -> Option<[u8; 4]> {
    let unzigzag16 = |v: u16| (v >> 1) ^ (v & 1).wrapping_neg();
    match (mode & 15, mode >> 4) {
        (0, 0) => Some(core::array::from_fn(|k| {
            let v = delta[k];
            before[k].wrapping_add((v >> 1) ^ (v & 1).wrapping_neg())
        })),
        (1, 0) => {
            let [a, b, c, d] = before;
            let [e, f, g, h] = delta;
            let sum = |v: [u8; 2], d: [u8; 2]| u16::from_le_bytes(v).wrapping_add(unzigzag16(u16::from_le_bytes(d)));
            let ([p, q], [r, s]) = (sum([a, b], [e, f]).to_le_bytes(), sum([c, d], [g, h]).to_le_bytes());
            Some([p, q, r, s])
        }
        (2, turn) => {
            let delta = u32::from_le_bytes(delta).rotate_left(u32::from(turn));
            Some((u32::from_le_bytes(before) ^ delta).to_le_bytes())
        }
        _ => None,
    }
}

/// Values that were pushed last; the most recent is 0.
struct Fifo<T> {
    items: [Option<T>; 16],
    next: usize,
}

impl<T: Copy> Fifo<T> {
    fn new() -> Self {
        Fifo {
            items: [None; 16],
            next: 0,
        }
    }

    fn push(&mut self, item: T) {
        self.items[self.next % 16] = Some(item);
        self.next += 1;
    }

    fn get(&self, back: usize) -> Option<T> {
        self.items[(self.next + 15 - back) % 16]
    }
}

/// Decoder of a list of triangles.
struct Triangles<'a> {
    data: Reader<'a>,
    edges: Fifo<[u32; 2]>,
    vertices: Fifo<u32>,
    /// The next index that has not been used, and the last that stood in the data.
    next: u32,
    last: u32,
}

fn triangles(packed: &[u8], count: usize) -> Option<Vec<u32>> {
    let (&header, rest) = packed.split_first()?;
    let (codes, rest) = rest.split_at_checked(count)?;
    let (data, table) = rest.split_at_checked(rest.len().checked_sub(16)?)?;
    if header != 0xe1 {
        return None;
    }
    let mut decoder = Triangles {
        data: Reader(data),
        edges: Fifo::new(),
        vertices: Fifo::new(),
        next: 0,
        last: 0,
    };
    let mut out = Vec::with_capacity(3 * count);
    for &code in codes {
        out.extend(decoder.triangle(code, table)?);
    }
    decoder.data.0.is_empty().then_some(out)
}

impl Triangles<'_> {
    fn fresh(&mut self) -> u32 {
        let index = self.next;
        self.next = self.next.wrapping_add(1);
        index
    }

    /// An index that stands in the data.
    fn explicit(&mut self) -> Option<u32> {
        let v = self.data.number()?;
        self.last = self.last.wrapping_add((v >> 1) ^ (v & 1).wrapping_neg());
        Some(self.last)
    }

    /// By half a byte: 0 a fresh index, 15 an explicit one, else one that was used lately. Whether it is to be remembered too.
    fn by_code(&mut self, code: u8) -> Option<(u32, bool)> {
        match code {
            0 => Some((self.fresh(), true)),
            15 => Some((self.explicit()?, true)),
            _ => Some((self.vertices.get(usize::from(code) - 1)?, false)),
        }
    }

    fn triangle(&mut self, code: u8, table: &[u8]) -> Option<[u32; 3]> {
        let (x, y) = (code >> 4, code & 15);
        if x < 15 {
            let [a, b] = self.edges.get(usize::from(x))?;
            let c = match y {
                0 => self.fresh(),
                1..13 => self.vertices.get(usize::from(y))?,
                13 | 14 => {
                    self.last = if y == 13 {
                        self.last.wrapping_sub(1)
                    } else {
                        self.last.wrapping_add(1)
                    };
                    self.last
                }
                _ => self.explicit()?,
            };
            if !(1..13).contains(&y) {
                self.vertices.push(c);
            }
            self.edges.push([c, b]);
            self.edges.push([a, c]);
            return Some([a, b, c]);
        }
        let (a, pair) = if y < 14 {
            (self.fresh(), table[usize::from(y)])
        } else {
            let pair = self.data.byte()?;
            if pair == 0 {
                self.next = 0;
            }
            (if y == 14 { self.fresh() } else { self.explicit()? }, pair)
        };
        let (b, remember_b) = self.by_code(pair >> 4)?;
        let (c, remember_c) = self.by_code(pair & 15)?;
        self.vertices.push(a);
        if remember_b {
            self.vertices.push(b);
        }
        if remember_c {
            self.vertices.push(c);
        }
        self.edges.push([b, a]);
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        Some([a, b, c])
    }
}

/// Indices as differences to either of two before.
fn indices(packed: &[u8], count: usize) -> Option<Vec<u32>> {
    let (&header, rest) = packed.split_first()?;
    let (data, _) = rest.split_at_checked(rest.len().checked_sub(4)?)?;
    // Every index takes a byte at least.
    if header != 0xd1 || count > data.len() {
        return None;
    }
    let mut reader = Reader(data);
    let mut last = [0u32; 2];
    let mut out = Vec::with_capacity(count);
    for _ in 0..count {
        let v = reader.number()?;
        let last = &mut last[(v & 1) as usize];
        *last = last.wrapping_add((v >> 2) ^ (v >> 1 & 1).wrapping_neg());
        out.push(*last);
    }
    reader.0.is_empty().then_some(out)
}

/// Undoes the filter that was applied before packing. Octahedral vectors stay as they are: normals are not read.
fn filter(name: &str, bytes: &mut [u8], stride: usize) -> Result<(), String> {
    match name {
        "" | "NONE" | "OCTAHEDRAL" => {}
        "EXPONENTIAL" => {
            for number in bytes.as_chunks_mut::<4>().0 {
                let packed = i32::from_le_bytes(*number);
                // A mantissa of 24 bits under an exponent of 8, both signed.
                let value = f64::from(packed << 8 >> 8) * f64::from(packed >> 24).exp2();
                *number = (value as f32).to_le_bytes();
            }
        }
        "QUATERNION" if stride == 8 => {
            for quaternion in bytes.as_chunks_mut::<8>().0 {
                *quaternion = unpacked_quaternion(*quaternion);
            }
        }
        _ => return Err(format!("the filter `{name}` on elements of {stride} bytes")),
    }
    Ok(())
}

/// Three components stand there, as shares of the root of a half; the fourth says which one was left out and what 1 is.
fn unpacked_quaternion(packed: [u8; 8]) -> [u8; 8] {
    let input: [i16; 4] = core::array::from_fn(|i| i16::from_le_bytes([packed[2 * i], packed[2 * i + 1]]));
    let one = f32::from(input[3] | 3);
    let [x, y, z] = [0, 1, 2].map(|i| f32::from(input[i]) / one * core::f32::consts::FRAC_1_SQRT_2);
    let left_out = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let largest = (input[3] & 3) as usize;
    let mut out = [0u8; 8];
    for (i, component) in [left_out, x, y, z].into_iter().enumerate() {
        let place = (largest + i) % 4;
        out[2 * place..][..2].copy_from_slice(&((component * 32767.0).round() as i16).to_le_bytes());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_of_differences_in_four_bits() {
        // The example of the specification.
        let packed = [0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5];
        let mut stream = vec![0b10];
        stream.extend(packed);
        let mut deltas = [0; 16];
        channel(&mut Reader(&stream), None, 16, &mut deltas).unwrap();
        let differences = deltas.map(|v| ((v >> 1) ^ (v & 1).wrapping_neg()) as i8);
        assert_eq!(differences, [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]);
    }

    #[test]
    fn indices_follow_two_baselines() {
        // 5, then 100 on the other baseline, then 6, then 99.
        let mut packed = vec![0xd1];
        for (baseline, delta) in [(0u32, 5i32), (1, 100), (0, 1), (1, -1)] {
            let zigzag = if delta < 0 {
                (!delta as u32) << 2 | 2
            } else {
                (delta as u32) << 2
            };
            let mut value = zigzag | baseline;
            while value > 0x7f {
                packed.push((value & 0x7f) as u8 | 0x80);
                value >>= 7;
            }
            packed.push(value as u8);
        }
        packed.extend([0; 4]);
        assert_eq!(indices(&packed, 4).unwrap(), [5, 100, 6, 99]);
        assert!(indices(&packed, 3).is_none() && indices(&packed, 5).is_none());
    }

    #[test]
    fn triangles_share_edges_and_vertices() {
        // Fresh 0 1 2; then across its last edge (2, 0 seen from there) a fresh 3; then explicit indices.
        let table = [0u8; 16];
        let mut packed = vec![0xe1, 0xf0, 0x00, 0xff];
        packed.extend([0xff, 14, 2, 1]);
        packed.extend(table);
        assert_eq!(triangles(&packed, 3).unwrap(), [0, 1, 2, 0, 2, 3, 7, 8, 7]);
        for length in 0..packed.len() {
            assert!(triangles(&packed[..length], 3).is_none(), "{length}");
        }
        // An edge before there is one.
        assert!(triangles(&[&[0xe1, 0x10][..], &table].concat(), 1).is_none());
    }

    #[test]
    fn filters_give_numbers_back() {
        let mut bytes = ((-2i32) << 24 | 5).to_le_bytes().to_vec();
        filter("EXPONENTIAL", &mut bytes, 4).unwrap();
        assert_eq!(bytes, 1.25f32.to_le_bytes());
        // Half a turn about y: its largest component is y.
        let packed: Vec<u8> = [0i16, 0, 0, 0x7ffc | 1].iter().flat_map(|x| x.to_le_bytes()).collect();
        let mut bytes = packed.clone();
        filter("QUATERNION", &mut bytes, 8).unwrap();
        let found: Vec<i16> = bytes.as_chunks().0.iter().map(|&raw| i16::from_le_bytes(raw)).collect();
        assert_eq!(found, [0, 32767, 0, 0]);
        assert!(filter("COLOR", &mut bytes, 8).is_err());
    }
}
