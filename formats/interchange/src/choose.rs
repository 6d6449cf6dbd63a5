//! Which meshes, which clip, which frames, which reference: what the user asked for, held against what a file has. One candidate
//! needs no word; several are named in the refusal.

use super::error::SequenceError;
use super::scene::{Contents, Moment, Motion, Space};
use core::str::FromStr;
use std::path::{Path, PathBuf};

/// More frames than any sequence has: a rate that asks for more is a slip.
const FRAMES_MAX: usize = 16 << 20;
/// Takes every mesh, unless one is called so.
const ALL: &str = "all";

/// What is wanted of a file. The default takes the only mesh (or the only one that deforms) and the only clip, every frame, the
/// first one as the reference.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Choice {
    /// Names of meshes, joined as pieces in the order of the file; `all` for every one. Empty: the only one.
    pub meshes: Vec<String>,
    /// Name of the clip; of FBX also a second file whose only clip moves nodes of the same names.
    pub clip: Option<String>,
    /// Frames of the clip; all if none.
    pub frames: Option<FrameRange>,
    /// Frames a second at which the clip is sampled anew.
    pub fps: Option<f64>,
    /// Which shape is the reference.
    pub pose: Pose,
    /// Coordinates.
    pub space: Space,
    /// The mesh that a point cache moves; where none is named, a mesh file beside the cache that has as many vertices.
    pub surface: Option<PathBuf>,
    /// Keep vertices apart that a format splits along seams of texture or normals: for writing to another file, not for learning.
    pub keep_split: bool,
}

/// The shape that is put first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Pose {
    /// The first of the chosen frames.
    #[default]
    First,
    /// The mesh as the file stores it, moved by no clip, put before the frames.
    Rest,
    /// A frame of the clip, counted from 0, put before the others.
    Frame(usize),
}

impl FromStr for Pose {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "first" => Ok(Pose::First),
            "rest" => Ok(Pose::Rest),
            _ => text
                .parse()
                .map(Pose::Frame)
                .map_err(|_| format!("`{text}` is neither `first`, `rest` nor the number of a frame, counted from 0")),
        }
    }
}

/// Frames `from` to `to`, both included, every `step`-th; counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameRange {
    /// The first.
    pub from: usize,
    /// The last; to the end if none.
    pub to: Option<usize>,
    /// At least 1.
    pub step: usize,
}

impl FromStr for FrameRange {
    type Err = String;

    /// `FROM..TO`, `FROM..TO:STEP`; either end may be left out.
    fn from_str(text: &str) -> Result<Self, String> {
        let refuse =
            || format!("`{text}` are no frames: write FROM..TO or FROM..TO:STEP, counted from 0, for example 10..49:2");
        let number = |text: &str| text.parse::<usize>().map_err(|_| refuse());
        let (range, step) = match text.split_once(':') {
            Some((range, step)) => (range, number(step)?),
            None => (text, 1),
        };
        let (from, to) = range.split_once("..").ok_or_else(refuse)?;
        let range = FrameRange {
            from: if from.is_empty() { 0 } else { number(from)? },
            to: if to.is_empty() { None } else { Some(number(to)?) },
            step,
        };
        if range.step == 0 || range.to.is_some_and(|to| to < range.from) {
            return Err(refuse());
        }
        Ok(range)
    }
}

/// What a choice means for one file.
#[derive(Debug)]
pub(crate) struct Plan {
    /// Indices of meshes, ascending.
    pub(crate) meshes: Vec<usize>,
    /// The clip, where there is one.
    pub(crate) clip: Option<usize>,
    /// The frames, the reference first, with the number of the frame in the clip.
    pub(crate) moments: Vec<(Moment, Option<usize>)>,
    /// Frames a second of the chosen frames.
    pub(crate) fps: Option<f64>,
    /// Meshes that were left out without a word from the user.
    pub(crate) left_out: Vec<String>,
}

/// Holds a choice against a file.
///
/// Errors: `Choose` with what there is to choose from, `FramesOutOfRange`, `NoTimes`.
pub(crate) fn plan(contents: &Contents, choice: &Choice, path: &Path) -> Result<Plan, SequenceError> {
    let (meshes, left_out) = choose_meshes(contents, choice, path)?;
    let clip = choose_clip(contents, choice.clip.as_deref(), path)?;
    let mut times = clip.map_or(Vec::new(), |clip| contents.clips[clip].times.clone());
    let mut fps = clip.and_then(|clip| contents.clips[clip].fps);
    if let (Some(rate), Some(clip)) = (choice.fps, clip) {
        let entry = &contents.clips[clip];
        if !entry.is_timed {
            return Err(SequenceError::NoTimes {
                path: path.into(),
                clip: entry.name.clone(),
            });
        }
        times = resampled(&times, rate).ok_or_else(|| SequenceError::NoSuchRate {
            path: path.into(),
            rate,
        })?;
        fps = Some(rate);
    }
    let at = |frame: usize| {
        let moment = Moment::At {
            clip: clip.unwrap_or(0),
            time: times[frame],
        };
        (moment, Some(frame))
    };
    let range = choice.frames.unwrap_or(FrameRange {
        from: 0,
        to: None,
        step: 1,
    });
    let frame_count = times.len();
    let in_range = |frame: usize| {
        if frame < frame_count {
            return Ok(frame);
        }
        Err(SequenceError::FramesOutOfRange {
            path: path.into(),
            frame,
            frame_count,
        })
    };
    let last = match range.to {
        Some(to) => in_range(to)?,
        None => frame_count.saturating_sub(1),
    };
    if choice.frames.is_some() {
        in_range(range.from)?;
    }
    let frames = (range.from..=last)
        .step_by(range.step)
        .filter(|&frame| frame < frame_count);
    let moments: Vec<_> = match choice.pose {
        Pose::First => frames.map(at).collect(),
        Pose::Rest => core::iter::once((Moment::Rest, None)).chain(frames.map(at)).collect(),
        Pose::Frame(pose) => {
            let pose = in_range(pose)?;
            core::iter::once(pose)
                .chain(frames.filter(|&frame| frame != pose))
                .map(at)
                .collect()
        }
    };
    fps = fps.map(|fps| fps / range.step as f64);
    Ok(Plan {
        meshes,
        clip,
        moments,
        fps,
        left_out,
    })
}

/// Indices of meshes, and names of those left out.
fn choose_meshes(
    contents: &Contents,
    choice: &Choice,
    path: &Path,
) -> Result<(Vec<usize>, Vec<String>), SequenceError> {
    let all = &contents.meshes;
    if all.is_empty() {
        return Err(SequenceError::NoMesh {
            path: path.into(),
            others: contents.others.clone(),
        });
    }
    let names = || {
        all.iter()
            .map(|mesh| format!("`{}` ({} vertices, {})", mesh.name, mesh.vertex_count, mesh.motion))
            .collect()
    };
    if choice.meshes.is_empty() {
        if all.len() == 1 {
            return Ok((vec![0], Vec::new()));
        }
        let deforming: Vec<usize> = (0..all.len()).filter(|&i| all[i].motion == Motion::Deforms).collect();
        if let [only] = deforming[..] {
            let others = (0..all.len())
                .filter(|&i| i != only)
                .map(|i| all[i].name.clone())
                .collect();
            return Ok((vec![only], others));
        }
        return Err(SequenceError::Choose {
            path: path.into(),
            what: "meshes",
            option: "--mesh NAME, several times for several, or --mesh all",
            wanted: None,
            names: names(),
        });
    }
    let mut chosen = Vec::new();
    for wanted in &choice.meshes {
        let found = find(all.iter().map(|mesh| mesh.name.as_str()), wanted);
        match found {
            Ok(mesh) => chosen.push(mesh),
            Err(0) if wanted == ALL => chosen.extend(0..all.len()),
            Err(_) => {
                return Err(SequenceError::Choose {
                    path: path.into(),
                    what: "meshes",
                    option: "--mesh NAME with the whole name, or --mesh all",
                    wanted: Some(wanted.clone()),
                    names: names(),
                });
            }
        }
    }
    chosen.sort_unstable();
    chosen.dedup();
    Ok((chosen, Vec::new()))
}

fn choose_clip(contents: &Contents, wanted: Option<&str>, path: &Path) -> Result<Option<usize>, SequenceError> {
    let clips = &contents.clips;
    let names = || {
        clips
            .iter()
            .map(|clip| format!("`{}` ({} frames)", clip.name, clip.times.len()))
            .collect()
    };
    let refuse = |wanted: Option<&str>| SequenceError::Choose {
        path: path.into(),
        what: "clips",
        option: "--clip NAME",
        wanted: wanted.map(String::from),
        names: names(),
    };
    if let Some(wanted) = wanted {
        let found = find(clips.iter().map(|clip| clip.name.as_str()), wanted);
        return found.map(Some).map_err(|_| refuse(Some(wanted)));
    }
    let moving: Vec<usize> = (0..clips.len()).filter(|&i| !clips[i].is_targets).collect();
    match (&moving[..], clips.len()) {
        ([], 0) => Ok(None),
        ([], _) => Ok(Some(0)),
        (&[only], _) => Ok(Some(only)),
        _ => Err(refuse(None)),
    }
}

/// The item of this name, or the only one whose path ends in it. The error says how many fit.
fn find<'a>(names: impl Iterator<Item = &'a str> + Clone, wanted: &str) -> Result<usize, usize> {
    if let Some(exact) = names.clone().position(|name| name == wanted) {
        return Ok(exact);
    }
    let ends = |name: &str| name.strip_suffix(wanted).is_some_and(|front| front.ends_with('/'));
    let fits: Vec<usize> = names
        .enumerate()
        .filter(|(_, name)| ends(name))
        .map(|(i, _)| i)
        .collect();
    match fits[..] {
        [only] => Ok(only),
        _ => Err(fits.len()),
    }
}

/// Times from the first to the last at a rate; none where the rate is no rate.
fn resampled(times: &[f64], rate: f64) -> Option<Vec<f64>> {
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
        return Some(Vec::new());
    };
    // A last frame that rounding pushes just past the end is still wanted.
    let count = ((last - first) * rate + 1e-6).floor() + 1.0;
    if !(rate > 0.0 && count >= 1.0 && count < FRAMES_MAX as f64) {
        return None;
    }
    Some(
        (0..count as usize)
            .map(|i| (first + i as f64 / rate).min(last))
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::super::scene::{ClipEntry, MeshEntry};
    use super::*;

    fn mesh(name: &str, motion: Motion) -> MeshEntry {
        MeshEntry {
            name: name.into(),
            vertex_count: 3,
            face_count: 1,
            joint_count: 0,
            morphs: Vec::new(),
            motion,
        }
    }

    fn contents() -> Contents {
        Contents {
            meshes: vec![
                mesh("a/body", Motion::Deforms),
                mesh("b/body", Motion::Deforms),
                mesh("b/hat", Motion::Whole),
            ],
            clips: vec![
                ClipEntry::timed("walk", (0..25).map(|i| i as f64 / 24.0).collect()),
                ClipEntry::untimed("poses", 3),
            ],
            ..Contents::default()
        }
    }

    fn choice(meshes: &[&str], clip: &str) -> Choice {
        Choice {
            meshes: meshes.iter().map(ToString::to_string).collect(),
            clip: (!clip.is_empty()).then(|| clip.into()),
            ..Choice::default()
        }
    }

    fn planned(contents: &Contents, choice: &Choice) -> Result<Plan, String> {
        plan(contents, choice, Path::new("a.abc")).map_err(|error| error.to_string())
    }

    #[test]
    fn several_candidates_are_named_and_one_needs_no_word() {
        let all = contents();
        let error = planned(&all, &choice(&[], "walk")).unwrap_err();
        assert!(
            error.contains("a/body") && error.contains("b/hat") && error.contains("--mesh"),
            "{error}"
        );
        let error = planned(&all, &choice(&["all"], "")).unwrap_err();
        assert!(
            error.contains("walk") && error.contains("poses") && error.contains("--clip"),
            "{error}"
        );
        for wrong in ["body", "leg", "ody"] {
            let error = planned(&all, &choice(&[wrong], "walk")).unwrap_err();
            assert!(
                error.contains(&format!("`{wrong}`")) && error.contains("a/body"),
                "{error}"
            );
        }
        assert_eq!(
            planned(&all, &choice(&["hat", "a/body"], "walk")).unwrap().meshes,
            [0, 2]
        );
        assert_eq!(planned(&all, &choice(&["all"], "walk")).unwrap().meshes, [0, 1, 2]);
        let mut fewer = all.clone();
        fewer.meshes.remove(0);
        fewer.clips.remove(1);
        let plan = planned(&fewer, &Choice::default()).unwrap();
        assert_eq!(
            (plan.meshes, plan.left_out, plan.moments.len()),
            (vec![0], vec!["b/hat".to_string()], 25)
        );
        fewer.meshes.clear();
        fewer.others.push(("curves".into(), 4));
        assert!(planned(&fewer, &Choice::default()).unwrap_err().contains("4 curves"));
    }

    #[test]
    fn morph_targets_serve_where_no_clip_moves_anything() {
        let mut all = contents();
        all.clips.truncate(1);
        all.clips.push(ClipEntry {
            is_targets: true,
            ..ClipEntry::untimed("targets", 3)
        });
        assert_eq!(planned(&all, &choice(&["hat"], "")).unwrap().clip, Some(0));
        all.clips.remove(0);
        assert_eq!(planned(&all, &choice(&["hat"], "")).unwrap().clip, Some(0));
        all.clips.clear();
        let plan = planned(&all, &choice(&["hat"], "")).unwrap();
        assert_eq!((plan.clip, plan.moments.len()), (None, 0));
    }

    #[test]
    fn frames_are_counted_from_zero_and_both_ends_are_included() {
        let all = contents();
        let mut wanted = choice(&["hat"], "walk");
        let frames = |wanted: &Choice| {
            let plan = planned(&all, wanted)?;
            Ok::<_, String>(
                plan.moments
                    .iter()
                    .map(|(_, frame)| frame.map_or(-1, |frame| frame as i32))
                    .collect::<Vec<_>>(),
            )
        };
        wanted.frames = Some("2..8:3".parse().unwrap());
        assert_eq!(frames(&wanted).unwrap(), [2, 5, 8]);
        wanted.pose = "5".parse().unwrap();
        assert_eq!(frames(&wanted).unwrap(), [5, 2, 8]);
        wanted.pose = "rest".parse().unwrap();
        assert_eq!(frames(&wanted).unwrap(), [-1, 2, 5, 8]);
        wanted.frames = Some("23..".parse().unwrap());
        assert_eq!(frames(&wanted).unwrap(), [-1, 23, 24]);
        for out in ["0..25", "25.."] {
            wanted.frames = Some(out.parse().unwrap());
            assert!(frames(&wanted).unwrap_err().contains("25 frames"), "{out}");
        }
        for wrong in ["", "3", "4..3", "1..2:0", "a..b", "1..2:x"] {
            assert!(wrong.parse::<FrameRange>().unwrap_err().contains(wrong), "{wrong}");
        }
    }

    #[test]
    fn a_rate_needs_times() {
        let mut wanted = choice(&["hat"], "walk");
        wanted.fps = Some(12.0);
        let plan = planned(&contents(), &wanted).unwrap();
        assert_eq!((plan.moments.len(), plan.fps), (13, Some(12.0)));
        assert_eq!(plan.moments[12].0, Moment::At { clip: 0, time: 1.0 });
        for wrong in [0.0, -1.0, f64::NAN, 1e300] {
            wanted.fps = Some(wrong);
            assert!(planned(&contents(), &wanted).is_err(), "{wrong}");
        }
        wanted.clip = Some("poses".into());
        wanted.fps = Some(12.0);
        assert!(planned(&contents(), &wanted).unwrap_err().contains("no times"));
    }
}
