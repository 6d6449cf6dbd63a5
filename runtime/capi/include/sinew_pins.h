/* Sinew for C, pins: vertices that the user holds and drags, and the weights that bring them to where the mouse wants them.
 * Written by cbindgen from runtime/capi/src: change that, not this file. sinew.h says what holds for all calls.
 *
 *   sinew_pins_create      once for each mesh that is dragged
 *   sinew_pins_add         when the user takes hold of a vertex
 *   sinew_pins_move        whenever the mouse moves
 *   sinew_pins_drag        each frame, before sinew_frame: moves the weights
 */

#ifndef SINEW_PINS_H
#define SINEW_PINS_H

#include "sinew.h"

/// Vertices pinned at once, at most.
#define SINEW_PINS_MAX 64

/// Pinned vertices, their targets, and the controls that dragging leaves alone.
typedef struct SinewPins SinewPins;

/// How a drag went.
typedef struct SinewDragReport {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// Largest distance of a pinned vertex from its target afterwards, units of the source; 0 where none is pinned.
  float misfit;
  /// Steps taken; 0 when none brought the vertices nearer, as when they are there.
  uint32_t step_count;
} SinewDragReport;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/// How much memory pins for this basis need: 12 bytes a vertex for each, 36 a vertex for all, and about 800 a control.
///
/// `capacity`: vertices pinned at once; more than `SINEW_PINS_MAX` count as that many.
SinewStatus sinew_pins_layout(const SinewBasis *basis, uint32_t capacity, SinewLayout *layout);

/// Makes pins; no vertex is pinned, no control locked.
///
/// `capacity`: as for `sinew_pins_layout`.
SinewStatus sinew_pins_create(const SinewBasis *basis, uint32_t capacity, void *memory, size_t memory_bytes,
                              SinewPins **pins, SinewDetails *details);

/// Pins a vertex where the workspace's last frame has it: costs one solve, and every drag from now on a little. Its target
/// is its place, so a vertex whose target is never moved is held there.
///
/// `workspace`: of the exact tier; keeps its pose.
/// `vertex`: source order.
///
/// Errors: `FOREIGN_PINS`, `FOREIGN_WORKSPACE`, `NEEDS_EXACT_TIER`, `NO_SUCH_VERTEX`, `ALREADY_PINNED`, `PINS_FULL`.
SinewStatus sinew_pins_add(const SinewBasis *basis, SinewPins *pins, SinewWorkspace *workspace, uint32_t vertex,
                           SinewDetails *details);

/// Lets go of a vertex.
///
/// Errors: `NOT_PINNED`.
SinewStatus sinew_pins_remove(SinewPins *pins, uint32_t vertex);

/// Lets go of all vertices. Locked controls stay locked.
SinewStatus sinew_pins_clear(SinewPins *pins);

/// Says where a pinned vertex should go; the next `sinew_pins_drag` moves it there.
///
/// `target`: three floats, units of the source.
///
/// Errors: `NOT_PINNED`, `NOT_FINITE`.
SinewStatus sinew_pins_move(SinewPins *pins, uint32_t vertex, const float *target);

/// Leaves a control alone while dragging, or no longer.
///
/// `is_locked`: 0: dragging moves it; anything else: it does not.
///
/// Errors: `NO_SUCH_CONTROL`.
SinewStatus sinew_pins_lock(SinewPins *pins, uint32_t control, int32_t is_locked);

/// Moves the weights so that the pinned vertices come nearer to their targets: once for each update of the mouse, and play
/// a frame afterwards. Coarse controls go as far as they are of use, then finer ones, each within its stops; of all ways, the
/// one with the least steps. Locked controls do not move. A fixed number of steps.
///
/// `workspace`: of the exact tier; lends its kernels and keeps its pose.
/// `controls`: the current pose; take that of the drag.
/// `report`: NULL, or takes how it went.
///
/// Errors: `FOREIGN_PINS`, `FOREIGN_WORKSPACE`, `FOREIGN_CONTROLS`, `NEEDS_EXACT_TIER`, `NOT_FINITE` (something wrote over
/// the weights), `PIN_OVERFLOW`.
SinewStatus sinew_pins_drag(const SinewBasis *basis, SinewPins *pins, SinewWorkspace *workspace,
                            SinewControls *controls, SinewDragReport *report, SinewDetails *details);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SINEW_PINS_H */
