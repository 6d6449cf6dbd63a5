//! PC2, the point cache of 3ds Max and of Blender's Mesh Cache modifier: frames counted, not timed.

use super::bytes::Bytes;
use super::cache::{Channel, PointCache, on_mesh, points_from};
use super::error::{Place, SequenceError};
use super::folder::file_name;
use super::format::{Format, Reading};
use super::mesh::PolygonMesh;
use super::scene::ClipEntry;
use super::text::unexpected;
use super::write::{FrameWriter, Output, OutputSurface, PointWriter, WriteError};
use std::path::Path;

pub(super) const FORMAT: Format = Format {
    name: "PC2",
    extensions: &["pc2"],
    reading: Reading::Points(|path, choice| {
        on_mesh(Box::new(Pc2::new(Bytes::open(path)?)?), FORMAT.name, path, choice)
    }),
    writing: Some(write),
};

const SIGNATURE: &[u8; 12] = b"POINTCACHE2\0";
/// Signature, version, points, start, rate, samples.
const HEADER_BYTES: u64 = 32;

/// Samples of V points of three little-endian f32.
struct Pc2 {
    bytes: Bytes,
    channels: [Channel; 1],
    clip: ClipEntry,
}

impl Pc2 {
    fn new(mut bytes: Bytes) -> Result<Pc2, SequenceError> {
        let path = bytes.path().to_path_buf();
        let header: [u8; HEADER_BYTES as usize] = bytes.array_at(0)?;
        if header[..12] != *SIGNATURE {
            return Err(unexpected(
                &path,
                Place::Byte(0),
                "the signature POINTCACHE2",
                Some(&header[..11]),
            ));
        }
        let number = |at: usize| i32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
        let (version, points, samples) = (number(12), number(16), number(28));
        if version != 1 {
            return Err(unexpected(
                &path,
                Place::Byte(12),
                "version 1",
                Some(version.to_string().as_bytes()),
            ));
        }
        let counts = usize::try_from(points)
            .ok()
            .filter(|&n| n > 0)
            .zip(usize::try_from(samples).ok().filter(|&n| n > 0));
        let Some((point_count, sample_count)) = counts else {
            let found = format!("{points} points in {samples} samples");
            return Err(unexpected(
                &path,
                Place::Byte(16),
                "points and samples",
                Some(found.as_bytes()),
            ));
        };
        PolygonMesh::check_vertex_count(point_count, &path)?;
        let needed = (point_count as u64 * 12).checked_mul(sample_count as u64);
        let body = bytes.len() - HEADER_BYTES;
        if needed.is_none_or(|needed| needed > body) {
            return Err(SequenceError::Parse {
                path,
                place: Place::Byte(HEADER_BYTES as usize),
                expected: format!("{sample_count} samples of {point_count} points"),
                found: format!("{body} bytes, enough for {}", body / (point_count as u64 * 12)),
            });
        }
        Ok(Pc2 {
            channels: [Channel {
                name: file_name(&path),
                point_count,
            }],
            clip: ClipEntry::untimed(file_name(&path), sample_count),
            bytes,
        })
    }
}

impl PointCache for Pc2 {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn clip(&self) -> &ClipEntry {
        &self.clip
    }

    fn points(&mut self, _: usize, frame: usize, out: &mut [[f32; 3]]) -> Result<(), SequenceError> {
        let size_bytes = 12 * out.len() as u64;
        let raw = self
            .bytes
            .vec_at(HEADER_BYTES + frame as u64 * size_bytes, size_bytes)?;
        points_from(&raw, f32::from_le_bytes, out);
        Ok(())
    }
}

/// Points of all frames, one after the other; the header at the end.
struct Writer {
    points: PointWriter,
}

fn write(path: &Path, surface: &OutputSurface<'_>) -> Result<Box<dyn FrameWriter>, WriteError> {
    let mut out = Output::create(path)?;
    out.put(&[0; HEADER_BYTES as usize])?;
    Ok(Box::new(Writer {
        points: PointWriter::new(out, surface),
    }))
}

impl FrameWriter for Writer {
    fn frame(&mut self, positions: &[[f32; 3]]) -> Result<(), WriteError> {
        self.points.frame(positions, f32::to_le_bytes)
    }

    fn finish(mut self: Box<Self>) -> Result<(), WriteError> {
        let [points, samples] = self.points.counts(FORMAT.name)?;
        let mut header = SIGNATURE.to_vec();
        header.extend([1, points].iter().flat_map(|n| n.to_le_bytes()));
        // Starts at frame 0, a sample a frame.
        header.extend([0.0f32, 1.0].iter().flat_map(|x| x.to_le_bytes()));
        header.extend(samples.to_le_bytes());
        self.points.out.patch(0, &header)?;
        self.points.out.commit()
    }
}
