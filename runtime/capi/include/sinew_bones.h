/* Sinew for C, bones: a few affine maps that the processor poses in microseconds and that a GPU skins the mesh by.
 * Written by cbindgen from runtime/capi/src: change that, not this file. sinew.h says what holds for all calls.
 *
 *   sinew_bones_skin       once: bones and weights of the vertices, for the vertex buffer
 *   sinew_bones_rest       once, for engines whose joints translate, rotate and scale: their bind pose
 *   sinew_workspace_create with SINEW_TIER_BONES, once for each mesh that is posed on its own
 *   sinew_bones_pose       each frame, instead of sinew_frame
 *
 * A vertex shader then adds up: position = sum over the vertex' bones of weight * (matrix * rest position).
 */

#ifndef SINEW_BONES_H
#define SINEW_BONES_H

#include "sinew.h"

/// How a bone is written.
typedef int32_t SinewBoneForm;
enum {
  /// 12 floats: a 3 x 4 matrix, row by row, that takes rest positions to posed ones. At rest it is the identity.
  SINEW_BONE_FORM_ROWS = 0,
  /// 12 floats: the same, column by column; the translation is the last column.
  SINEW_BONE_FORM_COLUMNS = 1,
  /// 10 floats: translation, unit quaternion x y z w, and scale of a joint, for engines that animate by these three. At rest
  /// it is what `sinew_bones_rest` gives. Shear is left out.
  SINEW_BONE_FORM_SCALED = 2,
};

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/// Poses the bones and writes where they are: all that a frame costs where an engine skins.
///
/// `workspace`: one of the bones (`SINEW_TIER_BONES`).
/// `form`: what stands in `maps`; one bone after the other.
/// `maps`, `map_floats`: 12 floats a bone, or 10; more stay untouched.
///
/// Errors: `NO_BONES`, `NEEDS_BONES`, `FOREIGN_WORKSPACE`, `FOREIGN_CONTROLS`, `UNKNOWN_OPTION`, `NOT_FINITE` (something wrote over
/// the weights), `FRAME_OVERFLOW` (then the bones are at rest).
SinewStatus sinew_bones_pose(const SinewBasis *basis, SinewWorkspace *workspace, const SinewControls *controls,
                             SinewBoneForm form, float *maps, size_t map_floats, SinewDetails *details);

/// Where the joints of the bones are at rest: 10 floats a bone, as `SINEW_BONE_FORM_SCALED` has them. The inverses of these are an
/// engine's inverse bind matrices.
///
/// Errors: `NO_BONES`.
SinewStatus sinew_bones_rest(const SinewBasis *basis, float *joints, size_t joint_floats, SinewDetails *details);

/// Which bones each vertex follows: 4 or 8 a vertex (`bone_influences` of the info), greatest weight first, source order.
///
/// `bones`, `bone_count`: indices of bones; 0 where the weight is 0.
/// `weights`, `weight_count`: in units of 1 / 65535; those of a vertex sum to 65535.
///
/// Errors: `NO_BONES`.
SinewStatus sinew_bones_skin(const SinewBasis *basis, uint8_t *bones, size_t bone_count, uint16_t *weights,
                             size_t weight_count, SinewDetails *details);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SINEW_BONES_H */
