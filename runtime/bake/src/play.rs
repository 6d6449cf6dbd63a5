//! What the runtime makes of poses: whatever the baker fits or measures, it plays as a host will.
//!
//! On the reference kernels: the same package bytes come out of every machine.

use sinew_formats::package::FEATURE_COUNT;
use sinew_runtime::{
    Basis, BoneMaps, BoneOutput, BoneTransform, Controls, Frame, FrameError, Kernels, TierChoice, Workspace,
    WorkspaceLayout,
};

use crate::BakeError;

/// `T - I` of a vertex, row-major.
pub type Gradient = [f64; 9];

/// One pose of an opened package, in source order. Shape: all `[V]`.
#[derive(Debug, Clone)]
pub struct Played {
    /// Units of the source.
    pub positions: Vec<[f32; 3]>,
    /// Unit vectors.
    pub normals: Vec<[f32; 3]>,
    /// Network units; empty where the tier has none at the vertices.
    pub features: Vec<[f32; FEATURE_COUNT]>,
}

/// Plays one pose from rest. Shape: `weights` `[K]`.
/// Errors: [`BakeError::Overflow`] for a pose that leaves f32.
pub fn play(basis: &Basis<'_>, tier: TierChoice, weights: &[f32]) -> Result<Played, BakeError> {
    let refused = |_| BakeError::NoTier { tier };
    let layout = WorkspaceLayout::for_tier(basis, tier).map_err(refused)?;
    let mut memory = vec![0; layout.unaligned_bytes()];
    let mut workspace = Workspace::for_tier(basis, tier, &mut memory, Kernels::Scalar).map_err(refused)?;
    let mut own = weights.to_vec();
    // Poses are made of the package's own stops: finite, one a component.
    let controls = Controls::resume(basis, &mut own).map_err(|_| BakeError::Overflow { vertex: 0 })?;
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let mut normals = positions.clone();
    let frame = Frame {
        basis,
        controls: &controls,
        positions: &mut positions,
        normals: Some(&mut normals),
    };
    frame.run(&mut workspace).map_err(|error| BakeError::Overflow {
        vertex: match error {
            FrameError::NotFinite { vertex } => vertex,
            _ => 0,
        },
    })?;
    let mut features = Vec::new();
    if tier == TierChoice::Exact {
        features = vec![[0.0; FEATURE_COUNT]; positions.len()];
        workspace
            .features(basis, &mut features)
            .map_err(|_| BakeError::NoTier { tier })?;
    }
    Ok(Played {
        positions,
        normals,
        features,
    })
}

/// `exp([r]x) S - I` of a vertex' features.
pub fn gradient(basis: &Basis<'_>, x: &[f32; FEATURE_COUNT]) -> Gradient {
    let (rotation, stretch) = (f64::from(basis.rotation_scale()), f64::from(basis.stretch_scale()));
    let x: [f64; FEATURE_COUNT] = core::array::from_fn(|c| f64::from(x[c]) * if c < 3 { rotation } else { stretch });
    let r = nalgebra::Vector3::new(x[0], x[1], x[2]);
    let rotation = nalgebra::Rotation3::new(r).into_inner();
    let stretch = nalgebra::Matrix3::new(1.0 + x[3], x[4], x[5], x[4], 1.0 + x[6], x[7], x[5], x[7], 1.0 + x[8]);
    let d = rotation * stretch - nalgebra::Matrix3::identity();
    core::array::from_fn(|n| d[(n / 3, n % 3)])
}

/// The bones in one pose: what a package with bones makes of the weights. Shape: `weights` `[K]`.
#[derive(Debug, Clone)]
pub struct Posed {
    /// `T - I` of the nodes. Shape: `[N]`, slots of the nodes.
    pub nodes: Vec<Gradient>,
    /// Shape: `[B]`.
    pub joints: Vec<BoneTransform>,
}

/// Poses the bones from rest.
/// Errors: those of [`play`].
pub fn pose(basis: &Basis<'_>, weights: &[f32]) -> Result<Posed, BakeError> {
    let tier = TierChoice::Bones;
    let refused = |_| BakeError::NoTier { tier };
    let layout = WorkspaceLayout::for_tier(basis, tier).map_err(refused)?;
    let mut memory = vec![0; layout.unaligned_bytes()];
    let mut workspace = Workspace::for_tier(basis, tier, &mut memory, Kernels::Scalar).map_err(refused)?;
    let mut own = weights.to_vec();
    let controls = Controls::resume(basis, &mut own).map_err(|_| BakeError::Overflow { vertex: 0 })?;
    let info = basis.bones().ok_or(BakeError::NoTier { tier })?;
    let mut joints: Vec<BoneTransform> = (0..info.count()).map(|b| info.rest_transform(b)).collect();
    let job = BoneMaps {
        basis,
        controls: &controls,
        maps: BoneOutput::Scaled(&mut joints),
    };
    job.run(&mut workspace).map_err(|_| BakeError::Overflow { vertex: 0 })?;
    let by_rows = |columns: &[[f32; 4]; 3]| core::array::from_fn(|n| f64::from(columns[n % 3][n / 3]));
    Ok(Posed {
        nodes: workspace.gradients().iter().map(by_rows).collect(),
        joints,
    })
}
