//! The bone tier: a few affine maps carry the mesh, so that a GPU skins and the frame only says where the bones are. Part of
//! a baked package; written by the baker, which fits it to poses of the exact tier, and read in place by the runtime.
//!
//! A frame decodes N *nodes*, averages over cells of the mesh, to gradients `D_n = T_n - I`. Everything behind that is
//! linear in them: a bone's gradient is a mixture of the nodes around it (*turns*), its displacement one of all nodes
//! (*pulls*) and of the weights themselves (*slides*):
//!
//! ```text
//! D_b = sum_n D_n turns[b][n]          d_b = sum_n D_n pulls[b][n] + sum_k z_k slides[b][k]
//! p_v = r_v + sum_b w_vb (D_b (r_v - c_b) + d_b)
//! ```

use rkyv::{Archive, Serialize, with::InlineAsBox};

use super::{BakedPatches, GROUP_NODES, PatchesView, archive::native};

/// Nodes that a bone's gradient is a mixture of.
pub const TURN_NODES: usize = 8;

/// What stands for 1 in the weights of a skin.
pub const SKIN_WEIGHT_SUM: u32 = u16::MAX as u32;

/// What a rest normal's whole numbers are multiples of: 1 / 32767.
pub const NORMAL_UNIT: f32 = 1.0 / i16::MAX as f32;

/// Whole numbers of sixteen bones side by side, for the x, y and z of what they multiply.
pub type BoneGroup = [[i16; GROUP_NODES]; 3];

/// B bones, N nodes, V vertices, K components; bones stand in H = ceil(B / 16) groups, the last perhaps short.
#[derive(Archive, Serialize, Debug, Clone, Copy)]
pub struct BakedBones<'a> {
    /// The components at the nodes. Slots are those of the nodes.
    pub patches: BakedPatches<'a>,
    /// N.
    pub node_count: u32,
    /// Where the bones are at rest; their gradients act about these places. Shape: `[B]`.
    #[rkyv(with = InlineAsBox)]
    pub rest_places: &'a [[f32; 3]],
    /// The axes along which a bone is scaled where only scales along axes are to be had: a unit quaternion x y z w that turns
    /// the coordinate axes onto them. Shape: `[B]`.
    #[rkyv(with = InlineAsBox)]
    pub axes: &'a [[f32; 4]],
    /// Slots of the nodes around each bone. Shape: `[B]`.
    #[rkyv(with = InlineAsBox)]
    pub turn_nodes: &'a [[u16; TURN_NODES]],
    /// What each of them counts, row-major 3 x 3, applied from the right. Shape: `[B]`.
    #[rkyv(with = InlineAsBox)]
    pub turns: &'a [[[f32; 9]; TURN_NODES]],
    /// What each node's gradient moves each bone by, times the bone's `pull_scales`. Shape: `[H][N]`.
    #[rkyv(with = InlineAsBox)]
    pub pulls: &'a [BoneGroup],
    /// Units of the source. Shape: `[16 H]`, zero beyond the last bone.
    #[rkyv(with = InlineAsBox)]
    pub pull_scales: &'a [f32],
    /// What a unit of each weight moves each bone by, times the bone's `slide_scales`. Shape: `[H][K]`.
    #[rkyv(with = InlineAsBox)]
    pub slides: &'a [BoneGroup],
    /// Units of the source. Shape: `[16 H]`, zero beyond the last bone.
    #[rkyv(with = InlineAsBox)]
    pub slide_scales: &'a [f32],
    /// How the vertices follow.
    pub skin: BakedSkin<'a>,
    /// How far the tier is from the exact one.
    pub error: BonesError,
}

/// I influences of each of V vertices, in their slots; I is 4 or 8.
#[derive(Archive, Serialize, Debug, Clone, Copy)]
pub struct BakedSkin<'a> {
    /// I.
    pub influences: u32,
    /// Bones, greatest weight first; 0 where the weight is 0. Shape: `[V][I]`.
    #[rkyv(with = InlineAsBox)]
    pub bones: &'a [u8],
    /// In units of 1 / 65535, falling; each row sums to 65535. Shape: `[V][I]`.
    #[rkyv(with = InlineAsBox)]
    pub weights: &'a [u16],
    /// Unit normals of the rest shape in units of [`NORMAL_UNIT`]; all zero where a vertex has no area around it. Shape: `[V]`.
    #[rkyv(with = InlineAsBox)]
    pub rest_normals: &'a [[i16; 3]],
}

/// How far the bone tier is from the exact one, measured when the package was baked: on *slider* poses, in which half of the
/// controls stand anywhere within 70 % of their ranges, and on poses like the training shapes', where the package knows those.
#[derive(Archive, Serialize, Debug, Clone, Copy, PartialEq, Default)]
pub struct BonesError {
    /// Slider poses, bones as affine maps.
    pub sliders: PoseError,
    /// Slider poses, bones that translate, rotate and scale along their axes.
    pub sliders_scaled: PoseError,
    /// Poses like the training shapes', affine.
    pub shapes: PoseError,
    /// Those, with scaled bones.
    pub shapes_scaled: PoseError,
}

/// Distances are shares of the diagonal of the rest shape's bounding box.
#[derive(Archive, Serialize, Debug, Clone, Copy, PartialEq, Default)]
pub struct PoseError {
    /// Root mean square over all vertices of all poses.
    pub rms: f32,
    /// 99 of 100 vertices are nearer than this.
    pub p99: f32,
    /// Greatest.
    pub max: f32,
    /// Root mean square angle between normals, radians.
    pub normal_rms: f32,
    /// How many poses there were; 0 where none was measured, and then all figures are 0.
    pub poses: u32,
}

/// The bone tier of an opened baked package. Fields mean what [`BakedBones`] says, and keep its promises.
#[derive(Clone, Copy, Debug)]
#[expect(missing_docs, reason = "fields are those of BakedBones")]
pub struct BonesView<'a> {
    pub patches: PatchesView<'a>,
    pub node_count: usize,
    pub rest_places: &'a [[f32; 3]],
    pub axes: &'a [[f32; 4]],
    pub turn_nodes: &'a [[u16; TURN_NODES]],
    pub turns: &'a [[[f32; 9]; TURN_NODES]],
    pub pulls: &'a [BoneGroup],
    pub pull_scales: &'a [f32],
    pub slides: &'a [BoneGroup],
    pub slide_scales: &'a [f32],
    pub skin: SkinView<'a>,
    pub error: BonesError,
}

/// How vertices follow bones. Fields mean what [`BakedSkin`] says, and keep its promises.
#[derive(Clone, Copy, Debug)]
#[expect(missing_docs, reason = "fields are those of BakedSkin")]
pub struct SkinView<'a> {
    pub influences: usize,
    pub bones: &'a [u8],
    pub weights: &'a [u16],
    pub rest_normals: &'a [[i16; 3]],
}

impl<'a> BonesView<'a> {
    pub(super) fn new(archived: &'a ArchivedBakedBones<'static>) -> Self {
        let skin = &archived.skin;
        let error = &archived.error;
        Self {
            patches: PatchesView::new(&archived.patches),
            node_count: archived.node_count.to_native() as usize,
            rest_places: native(&archived.rest_places),
            axes: native(&archived.axes),
            turn_nodes: native(&archived.turn_nodes),
            turns: native(&archived.turns),
            pulls: native(&archived.pulls),
            pull_scales: native(&archived.pull_scales),
            slides: native(&archived.slides),
            slide_scales: native(&archived.slide_scales),
            skin: SkinView {
                influences: skin.influences.to_native() as usize,
                bones: native(&skin.bones),
                weights: native(&skin.weights),
                rest_normals: native(&skin.rest_normals),
            },
            error: BonesError {
                sliders: pose_error(&error.sliders),
                sliders_scaled: pose_error(&error.sliders_scaled),
                shapes: pose_error(&error.shapes),
                shapes_scaled: pose_error(&error.shapes_scaled),
            },
        }
    }
}

fn pose_error(archived: &ArchivedPoseError) -> PoseError {
    PoseError {
        rms: archived.rms.to_native(),
        p99: archived.p99.to_native(),
        max: archived.max.to_native(),
        normal_rms: archived.normal_rms.to_native(),
        poses: archived.poses.to_native(),
    }
}
