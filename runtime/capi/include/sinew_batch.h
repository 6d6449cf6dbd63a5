/* Sinew for C, batches: many instances of one package, played by as many threads as you lend. No thread is made here, and
 * none waits. Written by cbindgen from runtime/capi/src: change that, not this file. sinew.h says what holds for all calls.
 *
 *   sinew_batch_create     once for a crowd
 *   sinew_batch_play       each frame, on each of your threads
 *   sinew_batch_begin      when they all have returned: the next round
 */

#ifndef SINEW_BATCH_H
#define SINEW_BATCH_H

#include "sinew.h"

/// A round of frames over many instances, whose handles and buffers stay in place until the last use of the batch.
typedef struct SinewBatch SinewBatch;

/// One instance: what `sinew_frame` would get. Members mean what they mean in `SinewFrameOptions`.
typedef struct SinewInstance {
  /// Its workspace, of either tier; no other instance's.
  SinewWorkspace *workspace;
  /// Its controls; no other instance's.
  const SinewControls *controls;
  /// Takes the deformed positions.
  float *positions;
  /// Floats that `positions` has room for: at least 3 V.
  size_t position_floats;
  /// Takes the normals; NULL where not wanted.
  float *normals;
  /// Floats that `normals` has room for: at least 3 V.
  size_t normal_floats;
} SinewInstance;

/// How an instance's last frame went.
typedef struct SinewInstanceReport {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// What `sinew_frame` would have returned; `SINEW_STATUS_OK` before the first frame.
  SinewStatus status;
  /// 0 before the first frame and where the frame was refused.
  SinewFrameOutcome outcome;
} SinewInstanceReport;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/// How much memory a batch needs.
SinewStatus sinew_batch_layout(size_t instance_count, SinewLayout *layout);

/// Makes a batch of instances, with its first round begun. Checks each against each, so it takes time with the square of
/// their number.
///
/// `instances`, `instance_count`, `instance_bytes`: copied; the last is `sizeof(SinewInstance)`. Handles are of `basis`;
/// those that are of other content are refused when they are played.
///
/// Errors: `OVERLAP` (of instances with each other too), `UNKNOWN_OPTION`.
SinewStatus sinew_batch_create(const SinewBasis *basis, const SinewInstance *instances, size_t instance_count,
                               size_t instance_bytes, void *memory, size_t memory_bytes, SinewBatch **batch,
                               SinewDetails *details);

/// Plays a frame of instances until none is left of this round. Any number of threads call it for one round; each instance
/// is played once, by the thread that comes first, and the results have the same bits whatever the number of threads. The
/// round is over when every call has returned; what became of each instance, `sinew_batch_report` says. Waits for nothing.
///
/// `basis`: of the instances' content.
/// `played`: NULL, or takes how many instances this call had.
///
/// Errors: none but the usual. A refusal of one instance stays with it.
SinewStatus sinew_batch_play(const SinewBasis *basis, const SinewBatch *batch, size_t *played, SinewDetails *details);

/// Begins the next round: every instance will be played again. `IN_USE` while another thread is playing.
SinewStatus sinew_batch_begin(SinewBatch *batch);

/// How an instance's last frame went; certain once the round is over.
///
/// Errors: `NO_SUCH_INSTANCE`.
SinewStatus sinew_batch_report(const SinewBatch *batch, size_t instance, SinewInstanceReport *report);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SINEW_BATCH_H */
