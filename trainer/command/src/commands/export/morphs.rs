//! Components as morph targets, where a straight blend is near enough.

use miette::{IntoDiagnostic, WrapErr};
use sinew_interchange::PuppetClip;
use sinew_runtime::Basis;
use sinew_trainer::evaluate::{PlayError, Player};
use sinew_trainer::learn::Reporter;
use sinew_trainer::learn::draft::with_players;

use super::played::{ClipReport, ClipSettings, Distances, check_stop, distance, report, widened};
use sinew_command::console::Console;
use sinew_command::inputs::Failure;

/// Poses between rest and each end of a range that a morph target is fitted to and measured at.
const MORPH_STEPS: usize = 4;

/// Components as morph targets.
#[derive(Default)]
pub struct Morphs {
    pub targets: Vec<(String, Vec<[f32; 3]>)>,
    /// The target of each component, and how far it is from the true movement at most, in units of the source. Shape: `[K]`.
    pub of_component: Vec<Option<(usize, f64)>>,
}

/// Fits a straight blend to each component alone: `argmin_d sum_i |p_i - r - w_i d|^2` over poses along its range.
pub fn fit_morphs(basis: &Basis<'_>, rest: &[[f32; 3]], allowed: f64, console: &Console) -> Result<Morphs, Failure> {
    let count = basis.component_count();
    console.stage("morph targets", count as u64);
    let fit = |player: &mut Player<'_>, &k: &usize| -> Result<(Vec<[f32; 3]>, f64), PlayError> {
        let component = basis.component(k);
        let ends = [component.minimum, component.maximum];
        let weights = ends
            .iter()
            .flat_map(|end| (1..=MORPH_STEPS).map(move |step| end * step as f32 / MORPH_STEPS as f32))
            .filter(|weight| *weight != 0.0);
        let mut row = vec![0.0; count];
        let mut poses = Vec::new();
        for weight in weights {
            row[k] = f64::from(weight);
            poses.push((f64::from(weight), player.play(&row)?.to_vec()));
        }
        let squares: f64 = poses.iter().map(|(weight, _)| weight * weight).sum();
        let direction = |v: usize, c: usize| {
            let sum = poses
                .iter()
                .map(|(weight, pose)| weight * f64::from(pose[v][c] - rest[v][c]));
            sum.sum::<f64>() / squares
        };
        let shape: Vec<[f32; 3]> = rest
            .iter()
            .enumerate()
            .map(|(v, at)| core::array::from_fn(|c| (f64::from(at[c]) + direction(v, c)) as f32))
            .collect();
        let mut farthest = 0.0_f64;
        for (weight, pose) in &poses {
            for ((pose, shape), rest) in pose.iter().zip(&shape).zip(rest) {
                let blended = core::array::from_fn(|c| rest[c] + *weight as f32 * (shape[c] - rest[c]));
                farthest = farthest.max(distance(pose, &blended));
            }
        }
        Ok((shape, farthest))
    };
    let all: Vec<usize> = (0..count).collect();
    let fits = with_players(basis, &all, fit).into_diagnostic()?;
    console.finish();
    let mut morphs = Morphs::default();
    for (k, (shape, farthest)) in fits.into_iter().enumerate() {
        let component = basis.component(k);
        let moves = component.minimum < component.maximum;
        morphs.of_component.push((moves && farthest <= allowed).then(|| {
            morphs.targets.push((component.name.into(), shape));
            (morphs.targets.len() - 1, farthest)
        }));
    }
    Ok(morphs)
}

impl Morphs {
    pub fn clip(
        &self,
        name: &str,
        rows: &[Vec<f32>],
        basis: &Basis<'_>,
        player: &mut Player<'_>,
        rest: &[[f32; 3]],
        settings: &ClipSettings<'_>,
    ) -> Result<(PuppetClip, ClipReport), Failure> {
        let own: Vec<usize> = (0..self.of_component.len())
            .filter(|&k| self.of_component[k].is_some())
            .collect();
        let mut distances = Distances::default();
        let mut weights = Vec::with_capacity(rows.len());
        for (n, row) in rows.iter().enumerate() {
            check_stop(settings.console, name, n)?;
            let chosen: Vec<f32> = own.iter().map(|&k| row[k]).collect();
            let blend = |v: usize, c: usize| {
                let targets = self.targets.iter().zip(&chosen);
                rest[v][c]
                    + targets
                        .map(|((_, shape), weight)| weight * (shape[v][c] - rest[v][c]))
                        .sum::<f32>()
            };
            let played: Vec<[f32; 3]> = (0..rest.len()).map(|v| core::array::from_fn(|c| blend(v, c))).collect();
            let true_positions = player
                .play(&widened(row))
                .into_diagnostic()
                .wrap_err_with(|| format!("frame {n} of clip {name} cannot be played"))?;
            distances.add(&played, true_positions);
            weights.push(chosen);
            settings.console.advance(n as u64 + 1, "");
        }
        let report = report(name, rows.len(), rows.len(), &distances, settings, basis);
        let clip = PuppetClip {
            name: name.into(),
            fps: settings.fps,
            frame_count: rows.len(),
            tracks: Vec::new(),
            weights,
        };
        Ok((clip, report))
    }
}
