//! MDD, LightWave's point cache, which Blender writes and reads: big-endian, with the time of every frame in seconds.

use super::bytes::Bytes;
use super::cache::{Channel, PointCache, on_mesh, points_from};
use super::error::{Place, SequenceError};
use super::folder::file_name;
use super::format::{Format, Reading};
use super::mesh::PolygonMesh;
use super::scene::ClipEntry;
use super::text::unexpected;
use super::write::{FrameWriter, Output, OutputSurface, PointWriter, WriteError};
use std::path::{Path, PathBuf};

pub(super) const FORMAT: Format = Format {
    name: "MDD",
    extensions: &["mdd"],
    reading: Reading::Points(|path, choice| {
        on_mesh(Box::new(Mdd::new(Bytes::open(path)?)?), FORMAT.name, path, choice)
    }),
    writing: Some(write),
};

/// Frames of V points of three big-endian f32.
struct Mdd {
    bytes: Bytes,
    channels: [Channel; 1],
    clip: ClipEntry,
    /// Bytes before the points.
    start: u64,
}

impl Mdd {
    fn new(mut bytes: Bytes) -> Result<Mdd, SequenceError> {
        let path = bytes.path().to_path_buf();
        let [frames, points] = [bytes.array_at(0)?, bytes.array_at(4)?].map(i32::from_be_bytes);
        let counts = usize::try_from(points)
            .ok()
            .filter(|&n| n > 0)
            .zip(usize::try_from(frames).ok().filter(|&n| n > 0));
        let Some((point_count, frame_count)) = counts else {
            let found = format!("{frames} frames of {points} points");
            return Err(unexpected(
                &path,
                Place::Byte(0),
                "the numbers of frames and points",
                Some(found.as_bytes()),
            ));
        };
        PolygonMesh::check_vertex_count(point_count, &path)?;
        let needed = (4 + point_count as u64 * 12)
            .saturating_mul(frame_count as u64)
            .saturating_add(8);
        if needed > bytes.len() {
            return Err(SequenceError::Parse {
                path,
                place: Place::Byte(8),
                expected: format!("{frame_count} frames of {point_count} points, {needed} bytes in all"),
                found: format!("{} bytes", bytes.len()),
            });
        }
        let raw = bytes.vec_at(8, 4 * frame_count as u64)?;
        let times: Vec<f64> = raw
            .as_chunks()
            .0
            .iter()
            .map(|&raw| f64::from(f32::from_be_bytes(raw)))
            .collect();
        let is_ascending = times.iter().all(|time| time.is_finite()) && times.windows(2).all(|pair| pair[0] < pair[1]);
        let clip = if is_ascending {
            ClipEntry::timed(file_name(&path), times)
        } else {
            // Some programs write no times: the frames are in order all the same.
            ClipEntry::untimed(file_name(&path), frame_count)
        };
        Ok(Mdd {
            channels: [Channel {
                name: file_name(&path),
                point_count,
            }],
            clip,
            start: 8 + 4 * frame_count as u64,
            bytes,
        })
    }
}

impl PointCache for Mdd {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn clip(&self) -> &ClipEntry {
        &self.clip
    }

    fn points(&mut self, _: usize, frame: usize, out: &mut [[f32; 3]]) -> Result<(), SequenceError> {
        let size_bytes = 12 * out.len() as u64;
        let raw = self.bytes.vec_at(self.start + frame as u64 * size_bytes, size_bytes)?;
        points_from(&raw, f32::from_be_bytes, out);
        Ok(())
    }
}

/// Points of all frames, kept apart until the times before them are known.
struct Writer {
    points: PointWriter,
    path: PathBuf,
    fps: f64,
}

fn write(path: &Path, surface: &OutputSurface<'_>) -> Result<Box<dyn FrameWriter>, WriteError> {
    Ok(Box::new(Writer {
        points: PointWriter::new(Output::apart(path)?, surface),
        path: path.into(),
        fps: surface.fps,
    }))
}

impl FrameWriter for Writer {
    fn frame(&mut self, positions: &[[f32; 3]]) -> Result<(), WriteError> {
        self.points.frame(positions, f32::to_be_bytes)
    }

    fn finish(self: Box<Self>) -> Result<(), WriteError> {
        let [points, frames] = self.points.counts(FORMAT.name)?;
        let mut out = Output::create(&self.path)?;
        out.put(&frames.to_be_bytes())?;
        out.put(&points.to_be_bytes())?;
        for frame in 0..frames {
            out.put(&((f64::from(frame) / self.fps) as f32).to_be_bytes())?;
        }
        out.append(self.points.out)?;
        out.commit()
    }
}
