//! Maya's caches: `.mc` (32-bit sizes) and `.mcx` (64-bit), all frames in one file or a file a frame, and the `.xml` that describes
//! them. Blocks of a tag, a size and padded content, big-endian; groups of them hold one frame of every channel.

use super::bytes::Bytes;
use super::cache::{Channel, PointCache, on_mesh, points_from};
use super::choose::Choice;
use super::error::{Place, SequenceError};
use super::folder::{file_name, read_file};
use super::format::{Format, Reading};
use super::mesh::PolygonMesh;
use super::scene::{ClipEntry, Scene};
use super::text::{quote, unexpected};
use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::{Path, PathBuf};

pub(super) const FORMAT: Format = Format {
    name: "Maya cache",
    extensions: &["mc", "mcx", "xml"],
    reading: Reading::Points(open),
    writing: None,
};

/// Maya's clock.
const TICKS_PER_SECOND: f64 = 6000.0;
/// Longest name of a channel.
const NAME_BYTES_MAX: u64 = 4096;
/// Largest description that is read.
const DESCRIPTION_BYTES_MAX: u64 = 16 << 20;

fn open(path: &Path, choice: &Choice) -> Result<Box<dyn Scene>, SequenceError> {
    let is_description = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("xml"));
    let (files, no_points) = if is_description {
        described(path)?
    } else {
        (frame_files(path)?, Vec::new())
    };
    let cache = MayaCache::new(path, &files, &no_points)?;
    on_mesh(Box::new(cache), FORMAT.name, path, choice)
}

/// The files that a description speaks of, and the channels that hold no positions.
fn described(path: &Path) -> Result<(Vec<PathBuf>, Vec<String>), SequenceError> {
    let length = fs::metadata(path).map_or(0, |metadata| metadata.len());
    let refuse = |expected: &str, found: String| SequenceError::Parse {
        path: path.into(),
        place: Place::Line(1),
        expected: expected.into(),
        found,
    };
    if length > DESCRIPTION_BYTES_MAX {
        return Err(refuse("a description of a Maya cache", format!("{length} bytes")));
    }
    let text = String::from_utf8_lossy(&read_file(path)?).into_owned();
    let document = roxmltree::Document::parse(&text).map_err(|error| SequenceError::Parse {
        path: path.into(),
        place: Place::Line(error.pos().row as usize),
        expected: "XML".into(),
        found: error.to_string(),
    })?;
    let root = document.root_element();
    if root.tag_name().name() != "Autodesk_Cache_File" {
        return Err(refuse(
            "the description of a Maya cache, Autodesk_Cache_File",
            quote(root.tag_name().name().as_bytes()),
        ));
    }
    let of_tag = |tag: &'static str| root.descendants().find(move |node| node.tag_name().name() == tag);
    let kind = of_tag("cacheType");
    let format = kind.and_then(|kind| kind.attribute("Format")).unwrap_or("mc");
    let extension = if format.ends_with('x') { "mcx" } else { "mc" };
    let holds_points = |node: &roxmltree::Node<'_, '_>| node.attribute("ChannelInterpretation") == Some("positions");
    let channels = root
        .descendants()
        .filter(|node| node.attribute("ChannelName").is_some());
    let no_points = channels
        .filter(|node| !holds_points(node))
        .filter_map(|node| node.attribute("ChannelName"));
    let no_points = no_points.map(String::from).collect();
    let one = path.with_extension(extension);
    let files = if kind.and_then(|kind| kind.attribute("Type")) == Some("OneFilePerFrame") {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        numbered_files(path, &stem, extension)?
    } else if one.is_file() {
        vec![one.clone()]
    } else {
        Vec::new()
    };
    if files.is_empty() {
        return Err(refuse(
            "the cache that this describes beside it",
            format!("no {}", one.display()),
        ));
    }
    Ok((files, no_points))
}

/// All files of a cache with a file a frame, of which `path` is one; or `path` alone.
fn frame_files(path: &Path) -> Result<Vec<PathBuf>, SequenceError> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let extension = path.extension().unwrap_or_default().to_string_lossy().into_owned();
    match name.rfind("Frame") {
        Some(at) if is_frame(&name[at..]) => numbered_files(path, &name[..at], &extension),
        _ => Ok(vec![path.into()]),
    }
}

/// `Frame12` or `Frame12Tick50`.
fn is_frame(text: &str) -> bool {
    let Some(numbers) = text.strip_prefix("Frame") else {
        return false;
    };
    let is_number = |text: &str| !text.is_empty() && text.trim_start_matches('-').bytes().all(|b| b.is_ascii_digit());
    match numbers.split_once("Tick") {
        Some((frame, tick)) => is_number(frame) && is_number(tick),
        None => is_number(numbers),
    }
}

/// Files `stemFrame12.mc` beside `path`, in natural order; their own times order them at last.
fn numbered_files(path: &Path, stem: &str, extension: &str) -> Result<Vec<PathBuf>, SequenceError> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let io = |source| SequenceError::Io {
        path: folder.into(),
        source,
    };
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(io)? {
        let file = entry.map_err(io)?.path();
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let fits = name.strip_prefix(stem).is_some_and(is_frame);
        if fits
            && file
                .extension()
                .is_some_and(|found| found.eq_ignore_ascii_case(extension))
        {
            files.push(file);
        }
    }
    files.sort_by(|a, b| natord::compare(&file_name(a), &file_name(b)));
    Ok(files)
}

/// Where the points of one frame of one channel lie.
#[derive(Debug, Clone, Copy)]
struct Points {
    file: usize,
    at: u64,
    is_double: bool,
}

/// Every frame of every channel, found but not read.
struct MayaCache {
    files: Vec<Bytes>,
    channels: Vec<Channel>,
    /// Shape: `[channels][frames]`.
    points: Vec<Vec<Points>>,
    clip: ClipEntry,
}

/// Frames of a channel while files are walked.
#[derive(Default)]
struct Found {
    /// By channel name: number of points, and frames by ticks.
    channels: HashMap<String, (usize, BTreeMap<i32, Points>)>,
    /// Names in the order of the file.
    order: Vec<String>,
}

impl MayaCache {
    fn new(path: &Path, files: &[PathBuf], no_points: &[String]) -> Result<MayaCache, SequenceError> {
        let mut found = Found::default();
        let mut opened = Vec::with_capacity(files.len());
        for file in files {
            let mut walk = Walk::new(Bytes::open(file)?)?;
            walk.file(opened.len(), &mut found)?;
            opened.push(walk.bytes);
        }
        let is_position = |name: &&String| !no_points.contains(name) && !name.ends_with("_normals");
        let names: Vec<String> = found.order.iter().filter(is_position).cloned().collect();
        let Some(first) = names.first() else {
            return Err(unexpected(path, Place::Byte(0), "a channel of positions", None));
        };
        let ticks: Vec<i32> = found.channels[first].1.keys().copied().collect();
        let (mut channels, mut points) = (Vec::new(), Vec::new());
        for name in &names {
            let (point_count, frames) = &found.channels[name];
            if !frames.keys().copied().eq(ticks.iter().copied()) {
                let expected = format!("channel `{name}` at the {} times of channel `{first}`", ticks.len());
                return Err(unexpected(
                    path,
                    Place::Byte(0),
                    &expected,
                    Some(format!("{} times", frames.len()).as_bytes()),
                ));
            }
            channels.push(Channel {
                name: name.clone(),
                point_count: *point_count,
            });
            points.push(frames.values().copied().collect());
        }
        let times = ticks.iter().map(|&ticks| f64::from(ticks) / TICKS_PER_SECOND).collect();
        Ok(MayaCache {
            files: opened,
            channels,
            points,
            clip: ClipEntry::timed(file_name(path), times),
        })
    }
}

impl PointCache for MayaCache {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn clip(&self) -> &ClipEntry {
        &self.clip
    }

    fn points(&mut self, channel: usize, frame: usize, out: &mut [[f32; 3]]) -> Result<(), SequenceError> {
        let Points { file, at, is_double } = self.points[channel][frame];
        let bytes_each = if is_double { 24 } else { 12 };
        let raw = self.files[file].vec_at(at, out.len() as u64 * bytes_each)?;
        if is_double {
            points_from(&raw, |raw| f64::from_be_bytes(raw) as f32, out);
        } else {
            points_from(&raw, f32::from_be_bytes, out);
        }
        Ok(())
    }
}

/// A block: its tag, where its content lies, and where the next block begins.
struct Block {
    tag: [u8; 4],
    start: u64,
    end: u64,
    next: u64,
}

/// Walks the blocks of one file.
struct Walk {
    bytes: Bytes,
    /// Sizes have 64 bits.
    is_wide: bool,
}

impl Walk {
    fn new(mut bytes: Bytes) -> Result<Walk, SequenceError> {
        let tag: [u8; 4] = bytes.array_at(0)?;
        let is_wide = match &tag {
            b"FOR4" => false,
            b"FOR8" => true,
            other => {
                return Err(unexpected(
                    bytes.path(),
                    Place::Byte(0),
                    "FOR4 or FOR8, a Maya cache",
                    Some(other),
                ));
            }
        };
        Ok(Walk { bytes, is_wide })
    }

    /// The block at `at`, which ends by `limit`.
    fn block(&mut self, at: u64, limit: u64) -> Result<Block, SequenceError> {
        let tag = self.bytes.array_at(at)?;
        let (size, start) = if self.is_wide {
            (u64::from_be_bytes(self.bytes.array_at(at + 8)?), at + 16)
        } else {
            (u64::from(u32::from_be_bytes(self.bytes.array_at(at + 4)?)), at + 8)
        };
        let padding = if self.is_wide { 8 } else { 4 };
        let end = start.checked_add(size).filter(|&end| end <= limit);
        let Some(end) = end else {
            let expected = format!("the block {} of {size} bytes", quote(&tag));
            let found = format!("{} bytes before its group ends", limit.saturating_sub(start));
            return Err(unexpected(
                self.bytes.path(),
                Place::Byte(at as usize),
                &expected,
                Some(found.as_bytes()),
            ));
        };
        // Content is padded by its own length, groups are not; the last block of a file may lack its padding.
        let padded = if matches!(&tag, b"FOR4" | b"FOR8") {
            size
        } else {
            size.next_multiple_of(padding)
        };
        let next = start.saturating_add(padded).min(limit);
        Ok(Block { tag, start, end, next })
    }

    /// Finds the points of all frames.
    fn file(&mut self, file: usize, found: &mut Found) -> Result<(), SequenceError> {
        let (mut at, length) = (0, self.bytes.len());
        let mut time = 0;
        while at < length {
            let group = self.block(at, length)?;
            let inside = group.start + 4;
            if matches!(&group.tag, b"FOR4" | b"FOR8") && inside <= group.end {
                match &self.bytes.array_at(group.start)? {
                    b"CACH" => time = self.header(inside, group.end)?.unwrap_or(time),
                    b"MYCH" => self.frame(inside, group.end, time, file, found)?,
                    _ => {}
                }
            }
            at = group.next.max(at + 1);
        }
        Ok(())
    }

    /// The time at which the file begins, in ticks: that of its frame, where a file holds one.
    fn header(&mut self, mut at: u64, end: u64) -> Result<Option<i32>, SequenceError> {
        let mut time = None;
        while at < end {
            let block = self.block(at, end)?;
            if &block.tag == b"STIM" {
                time = Some(self.number(&block)?);
            }
            at = block.next.max(at + 1);
        }
        Ok(time)
    }

    /// One frame of all channels.
    fn frame(
        &mut self,
        mut at: u64,
        end: u64,
        mut time: i32,
        file: usize,
        found: &mut Found,
    ) -> Result<(), SequenceError> {
        let (mut name, mut count) = (String::new(), 0u64);
        while at < end {
            let block = self.block(at, end)?;
            let size = block.end - block.start;
            match &block.tag {
                b"TIME" => time = self.number(&block)?,
                b"CHNM" => {
                    let raw = self.bytes.vec_at(block.start, size.min(NAME_BYTES_MAX))?;
                    name = String::from_utf8_lossy(raw.split(|&b| b == 0).next().unwrap_or_default()).into_owned();
                }
                b"SIZE" => count = u64::from(self.number(&block)?.unsigned_abs()),
                b"FVCA" | b"DVCA" => {
                    let is_double = &block.tag == b"DVCA";
                    let bytes_each = if is_double { 24 } else { 12 };
                    if count * bytes_each != size || count == 0 {
                        let expected = format!("{count} points of channel `{name}`");
                        let bytes = format!("{size} bytes");
                        return Err(unexpected(
                            self.bytes.path(),
                            Place::Byte(at as usize),
                            &expected,
                            Some(bytes.as_bytes()),
                        ));
                    }
                    let points = Points {
                        file,
                        at: block.start,
                        is_double,
                    };
                    found.add(core::mem::take(&mut name), count as usize, time, points, &self.bytes)?;
                }
                _ => {}
            }
            at = block.next.max(at + 1);
        }
        Ok(())
    }

    fn number(&mut self, block: &Block) -> Result<i32, SequenceError> {
        if block.end - block.start < 4 {
            return Err(unexpected(
                self.bytes.path(),
                Place::Byte(block.start as usize),
                "a number of four bytes",
                None,
            ));
        }
        Ok(i32::from_be_bytes(self.bytes.array_at(block.start)?))
    }
}

impl Found {
    fn add(
        &mut self,
        name: String,
        count: usize,
        time: i32,
        points: Points,
        bytes: &Bytes,
    ) -> Result<(), SequenceError> {
        PolygonMesh::check_vertex_count(count, bytes.path())?;
        let refuse = |expected: String, found: String| {
            unexpected(
                bytes.path(),
                Place::Byte(points.at as usize),
                &expected,
                Some(found.as_bytes()),
            )
        };
        let (known, frames) = self.channels.entry(name.clone()).or_insert_with(|| {
            self.order.push(name.clone());
            (count, BTreeMap::new())
        });
        if *known != count {
            return Err(refuse(
                format!("{known} points of channel `{name}`, as before"),
                format!("{count}"),
            ));
        }
        if frames.insert(time, points).is_some() {
            return Err(refuse(
                format!("one frame of channel `{name}` at {time} ticks"),
                "another one".into(),
            ));
        }
        Ok(())
    }
}
