/* Written from the sources in runtime/capi/src by cbindgen: change those, not this file.
 *
 * Sinew: plays learned deformation components. A baked package holds a mesh and its components; controls move them; a
 * frame writes the deformed positions and normals.
 *
 * Order of a program
 *   sinew_basis_open         once for each package: all checks, no copies
 *   sinew_workspace_create   once for each mesh that is posed on its own
 *   sinew_controls_create    likewise
 *   sinew_control_set        whenever a knob moves
 *   sinew_frame              each frame
 *
 * Memory
 *   All of it is yours. A layout call says how much a handle needs and how it is aligned; the handle then lies in that
 *   memory. Nothing is ever allocated, so there is nothing to free: give the memory back when the last use is over.
 *   These must stay in place, and be written by nobody else:
 *     the package's bytes    until the last use of the basis
 *     the basis's memory     until the last use of the basis
 *     a workspace's memory   until the last use of the workspace
 *     the controls' memory   until the last use of the controls
 *   Workspaces and controls may outlive a basis: open the same content again, anywhere, and they go on. With other content
 *   they are refused. Handles that were closed, moved, written over or confused are refused too, by marks in their
 *   memory; memory that was freed is found by these marks only with luck.
 *
 * Faults
 *   Every call returns a status. Unless the status says otherwise, a call that does not return SINEW_STATUS_OK has
 *   changed nothing, results included. "Errors" lists the statuses without SINEW_STATUS_; every function that takes
 *   pointers also returns NULL_POINTER, MISALIGNED and, for a defect of the library, INTERNAL. "Those of a handle" are
 *   NOT_A_HANDLE, WRONG_HANDLE, CLOSED_HANDLE, MOVED_HANDLE, DAMAGED_HANDLE and IN_USE.
 *
 * Threads
 *   There is no global state. A basis serves any number of threads; a workspace or controls handle one call at a time. A
 *   second call at the same moment is refused with IN_USE; making a handle in memory that is in use is not noticed.
 *
 * Structs
 *   Their first member is their own size: set it to sizeof. Zero in the others means "as usual", so that structs can grow.
 *
 * Build (Linux; the library is made by `cargo build --release -p sinew-capi`)
 *   gcc -std=c99 -Iruntime/capi/include pose.c target/release/libsinew.a -lpthread -ldl -lm
 *   gcc -std=c99 -Iruntime/capi/include pose.c -Ltarget/release -lsinew -Wl,-rpath,target/release
 */

#ifndef SINEW_H
#define SINEW_H

#include <stddef.h>
#include <stdint.h>

/**
 * Version of this interface. Rises when a function, a struct or a status code changes its meaning; additions leave it.
 */
#define SINEW_ABI_VERSION 1

/**
 * Bytes of the text in `SinewDetails`, with the NUL.
 */
#define SINEW_DETAILS_TEXT_BYTES 228

/**
 * Bytes of a buffer that holds any control's name, with the NUL.
 */
#define SINEW_NAME_BYTES 65

/**
 * Stands where an index is absent: the parent of a coarse control.
 */
#define SINEW_NONE UINT32_MAX

/**
 * What a call returns. Unless a status says otherwise, a call that returns anything but `SINEW_STATUS_OK` has changed
 * nothing. New codes may be added: treat an unknown one as a fault.
 */
enum SinewStatus
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Done.
   */
  SINEW_STATUS_OK = 0,
  /**
   * A pointer that must not be NULL is.
   */
  SINEW_STATUS_NULL_POINTER = 1,
  /**
   * A pointer does not start at a multiple of its type's alignment, or memory not at that of its layout.
   */
  SINEW_STATUS_MISALIGNED = 2,
  /**
   * Memory or a buffer is shorter than it must be; the layout call or the count says how long.
   */
  SINEW_STATUS_TOO_SHORT = 3,
  /**
   * A length that no object has: it would reach beyond the address space.
   */
  SINEW_STATUS_TOO_LONG = 4,
  /**
   * Memory that this call writes overlaps other memory that it uses.
   */
  SINEW_STATUS_OVERLAP = 5,
  /**
   * A struct's first member is not its size; set it to `sizeof`.
   */
  SINEW_STATUS_STRUCT_SIZE = 6,
  /**
   * A struct of a newer header asks for something that this library does not know.
   */
  SINEW_STATUS_UNKNOWN_OPTION = 7,
  /**
   * The header belongs to another interface version than the library.
   */
  SINEW_STATUS_WRONG_ABI = 8,
  /**
   * Not a handle: never made, or its memory was freed or written over.
   */
  SINEW_STATUS_NOT_A_HANDLE = 10,
  /**
   * A handle of another kind.
   */
  SINEW_STATUS_WRONG_HANDLE = 11,
  /**
   * The handle was closed, or a call that wrote it ended with `SINEW_STATUS_INTERNAL`.
   */
  SINEW_STATUS_CLOSED_HANDLE = 12,
  /**
   * The handle was copied or moved from where it was made; make it anew where it shall stay.
   */
  SINEW_STATUS_MOVED_HANDLE = 13,
  /**
   * Something wrote over the handle's memory.
   */
  SINEW_STATUS_DAMAGED_HANDLE = 14,
  /**
   * Another thread is using the handle at this moment.
   */
  SINEW_STATUS_IN_USE = 15,
  /**
   * The workspace was made for other content than the basis has now.
   */
  SINEW_STATUS_FOREIGN_WORKSPACE = 16,
  /**
   * The controls were made for other content than the basis has now.
   */
  SINEW_STATUS_FOREIGN_CONTROLS = 17,
  /**
   * The index of a control is not less than their count.
   */
  SINEW_STATUS_NO_SUCH_CONTROL = 20,
  /**
   * No control has this name.
   */
  SINEW_STATUS_NO_SUCH_NAME = 21,
  /**
   * A weight is NaN or infinite; the weights stay as they were.
   */
  SINEW_STATUS_NOT_FINITE = 22,
  /**
   * The weights are so large that a position left f32. The outputs hold the rest shape, the workspace is at rest.
   */
  SINEW_STATUS_FRAME_OVERFLOW = 23,
  /**
   * A defect of the library, stopped at its edge; the handles that the call was writing are closed, its outputs may be half
   * written. Please report it.
   */
  SINEW_STATUS_INTERNAL = 99,
  /**
   * Fewer bytes than a package's header.
   */
  SINEW_STATUS_PACKAGE_TOO_SHORT = 100,
  /**
   * The first bytes are not a package's.
   */
  SINEW_STATUS_PACKAGE_WRONG_MAGIC = 101,
  /**
   * The header's checksum does not fit.
   */
  SINEW_STATUS_PACKAGE_HEADER_CORRUPT = 102,
  /**
   * A format version that this library does not read.
   */
  SINEW_STATUS_PACKAGE_UNSUPPORTED_VERSION = 103,
  /**
   * Reserved bytes of the header are in use.
   */
  SINEW_STATUS_PACKAGE_RESERVED_NOT_ZERO = 104,
  /**
   * The header names an unknown kind of package.
   */
  SINEW_STATUS_PACKAGE_UNKNOWN_KIND = 105,
  /**
   * A compact package where a baked one is needed; `sinew bake` makes one.
   */
  SINEW_STATUS_PACKAGE_WRONG_KIND = 106,
  /**
   * The package ends early.
   */
  SINEW_STATUS_PACKAGE_TRUNCATED = 107,
  /**
   * Bytes follow the package.
   */
  SINEW_STATUS_PACKAGE_TRAILING_BYTES = 108,
  /**
   * The bytes do not start at a multiple of 16.
   */
  SINEW_STATUS_PACKAGE_MISALIGNED = 109,
  /**
   * The payload's checksum does not fit.
   */
  SINEW_STATUS_PACKAGE_PAYLOAD_CORRUPT = 110,
  /**
   * The content id is not the content's.
   */
  SINEW_STATUS_PACKAGE_CONTENT_ID_MISMATCH = 111,
  /**
   * The payload is not an archive of its kind.
   */
  SINEW_STATUS_PACKAGE_MALFORMED = 112,
  /**
   * A number is NaN or infinite.
   */
  SINEW_STATUS_PACKAGE_NOT_FINITE = 113,
  /**
   * A number lies outside its range.
   */
  SINEW_STATUS_PACKAGE_OUT_OF_RANGE = 114,
  /**
   * A number that must be above zero is not.
   */
  SINEW_STATUS_PACKAGE_NOT_POSITIVE = 115,
  /**
   * A pivot of the factor is not above zero.
   */
  SINEW_STATUS_PACKAGE_PIVOT_NOT_POSITIVE = 116,
  /**
   * An index points past the end.
   */
  SINEW_STATUS_PACKAGE_INDEX_OUT_OF_RANGE = 117,
  /**
   * Two counts that must agree do not.
   */
  SINEW_STATUS_PACKAGE_COUNT_MISMATCH = 118,
  /**
   * A field has fewer elements than make sense.
   */
  SINEW_STATUS_PACKAGE_TOO_FEW = 119,
  /**
   * A field has more elements than the format allows.
   */
  SINEW_STATUS_PACKAGE_TOO_MANY = 120,
  /**
   * Elements that must ascend do not.
   */
  SINEW_STATUS_PACKAGE_NOT_ASCENDING = 121,
  /**
   * A block's parent is missing or comes after it.
   */
  SINEW_STATUS_PACKAGE_PARENT_AFTER_CHILD = 122,
  /**
   * Parts that must follow one another do not.
   */
  SINEW_STATUS_PACKAGE_NOT_CONTIGUOUS = 123,
  /**
   * The two vertex orders are not each other's inverse.
   */
  SINEW_STATUS_PACKAGE_NOT_A_PERMUTATION = 124,
  /**
   * An edge differs in its two directions.
   */
  SINEW_STATUS_PACKAGE_NOT_SYMMETRIC = 125,
  /**
   * A bit beyond the last vertex is set.
   */
  SINEW_STATUS_PACKAGE_BITMAP_TAIL = 126,
  /**
   * The range of a control leaves out zero.
   */
  SINEW_STATUS_PACKAGE_RANGE_WITHOUT_ZERO = 127,
  /**
   * A name is empty, too long or has control characters.
   */
  SINEW_STATUS_PACKAGE_NAME_INVALID = 128,
  /**
   * Two controls have one name.
   */
  SINEW_STATUS_PACKAGE_NAME_DUPLICATE = 129,
  /**
   * The skin weights of a vertex of the fast tier do not sum to one.
   */
  SINEW_STATUS_PACKAGE_SKIN_WEIGHT_SUM = 130,
  /**
   * A triangle of render vertices does not stand for the corners of its triangle.
   */
  SINEW_STATUS_PACKAGE_RENDER_FACE_DIFFERS = 131,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewStatus SinewStatus;
#else
typedef int32_t SinewStatus;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What a frame had to do.
 */
enum SinewFrameOutcome
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * The controls had moved: decoded and solved.
   */
  SINEW_FRAME_OUTCOME_SOLVED = 1,
  /**
   * The controls were those of the workspace's last frame: its solution was written out again.
   */
  SINEW_FRAME_OUTCOME_UNCHANGED = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewFrameOutcome SinewFrameOutcome;
#else
typedef int32_t SinewFrameOutcome;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * An opened package, in memory of yours. Refers to the package's bytes: keep both in place, unchanged, until the last
 * use of the basis.
 */
typedef struct SinewBasis SinewBasis;

/**
 * One weight a component, 0 at rest, in memory of yours.
 */
typedef struct SinewControls SinewControls;

/**
 * The buffers of one frame at a time, in memory of yours: about 132 bytes a vertex. One for every mesh that is posed on
 * its own; any number may share a basis.
 */
typedef struct SinewWorkspace SinewWorkspace;

/**
 * How much memory a handle needs. Fixed for ever, hence without a size of its own.
 */
typedef struct SinewLayout {
  /**
   * Bytes.
   */
  size_t size_bytes;
  /**
   * The memory must start at a multiple of this: a power of two, at most 64.
   */
  size_t alignment;
} SinewLayout;

/**
 * Why a call was refused. Set `struct_bytes` to `sizeof(SinewDetails)`; the rest is written when a call that takes the
 * struct returns anything but `SINEW_STATUS_OK`, and is left alone otherwise.
 */
typedef struct SinewDetails {
  /**
   * `sizeof(SinewDetails)`.
   */
  size_t struct_bytes;
  /**
   * Index of the element at fault: control, vertex, element of a package's field. 0 where the fault has none.
   */
  uint64_t index;
  /**
   * What was needed: a length, a count, a limit, a version. 0 where the fault has none.
   */
  uint64_t expected;
  /**
   * What was found instead. 0 where the fault has none.
   */
  uint64_t actual;
  /**
   * The status that the call returned.
   */
  SinewStatus status;
  /**
   * One English sentence for a log, UTF-8, ended by NUL; cut off if it is too long.
   */
  char text[SINEW_DETAILS_TEXT_BYTES];
} SinewDetails;

/**
 * What a package holds. Set `struct_bytes` to `sizeof(SinewBasisInfo)` before the call.
 */
typedef struct SinewBasisInfo {
  /**
   * `sizeof(SinewBasisInfo)`.
   */
  size_t struct_bytes;
  /**
   * V: elements of positions and normals.
   */
  uint32_t vertex_count;
  /**
   * F: triangles.
   */
  uint32_t face_count;
  /**
   * K: controls, one a component.
   */
  uint32_t control_count;
  /**
   * Levels of components, coarse to fine; at least 1.
   */
  uint32_t level_count;
  /**
   * Identity of the content: packages with the same one play the same.
   */
  uint8_t content_id[16];
  /**
   * Identity of the compact package that this one was baked from.
   */
  uint8_t compact_id[16];
} SinewBasisInfo;

/**
 * Where a frame writes. Start from zeros (`SinewFrameOptions options = {0};`), then set `struct_bytes` and what you
 * want: zero means "not wanted" or "as usual" for every member, also for those that later versions add.
 */
typedef struct SinewFrameOptions {
  /**
   * `sizeof(SinewFrameOptions)`.
   */
  size_t struct_bytes;
  /**
   * Takes the deformed positions, xyz for each vertex, source order, units of the source. Not NULL.
   */
  float *positions;
  /**
   * Floats that `positions` has room for: at least 3 V; more stay untouched.
   */
  size_t position_floats;
  /**
   * Takes unit vertex normals, xyz for each vertex, source order. NULL where not wanted.
   */
  float *normals;
  /**
   * Floats that `normals` has room for: at least 3 V; more stay untouched.
   */
  size_t normal_floats;
} SinewFrameOptions;

/**
 * What a frame tells besides its buffers. Set `struct_bytes` to `sizeof(SinewFrameReport)` before the call.
 */
typedef struct SinewFrameReport {
  /**
   * `sizeof(SinewFrameReport)`.
   */
  size_t struct_bytes;
  /**
   * What the frame had to do.
   */
  SinewFrameOutcome outcome;
} SinewFrameReport;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * The library's version, for example "0.1.0". Never NULL, never freed.
 *
 * Threads: any.
 */
const char *sinew_version(void);

/**
 * The interface version that the library was built with; `SINEW_ABI_VERSION` is that of the header. `sinew_basis_open`
 * compares the two.
 *
 * Threads: any.
 */
uint32_t sinew_abi_version(void);

/**
 * What a status means, in one English sentence without a full stop. Never NULL, never freed, unknown codes included.
 *
 * Threads: any.
 */
const char *sinew_status_text(int32_t status);

/**
 * The name of a status as this header spells it, for logs. Never NULL, never freed, unknown codes included.
 *
 * Threads: any.
 */
const char *sinew_status_name(int32_t status);

/**
 * How much memory a basis handle needs; the same for every package.
 *
 * Errors: `NULL_POINTER`, `MISALIGNED`.
 * Threads: any.
 *
 * # Safety
 * `layout` is NULL or writable.
 */
SinewStatus sinew_basis_layout(struct SinewLayout *layout);

/**
 * Opens a baked package: every check that costs more than a few comparisons is here, and no later call can fail because
 * of the package. Copies nothing.
 *
 * `abi_version`: pass `SINEW_ABI_VERSION`.
 * `bytes`, `length`: the whole package, `length` exact, starting at a multiple of 16; `malloc` and file maps do.
 * `memory`, `memory_bytes`: at least what `sinew_basis_layout` says.
 * `basis`: takes the handle, which lies at `memory`.
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Opening again in the same memory is allowed when nothing uses the old handle; workspaces and controls of other content
 * are then refused.
 *
 * Errors: `WRONG_ABI`, `NULL_POINTER`, `MISALIGNED`, `TOO_SHORT`, `TOO_LONG`, `OVERLAP`, `STRUCT_SIZE`, every `PACKAGE_...`.
 * Threads: any; one call for one `memory`.
 *
 * # Safety
 * Pointers are NULL or point to memory of the stated lengths. `bytes` and `memory` stay in place, and are written by nobody
 * else, until the last use of the basis.
 */
SinewStatus sinew_basis_open(uint32_t abi_version,
                             const uint8_t *bytes,
                             size_t length,
                             uint8_t *memory,
                             size_t memory_bytes,
                             struct SinewBasis **basis,
                             struct SinewDetails *details);

/**
 * Ends a basis: later calls with it are refused with `CLOSED_HANDLE` while its memory stands. There is nothing to free, so
 * this is optional before memory and package are given back.
 *
 * Errors: those of a handle.
 * Threads: any, when no other uses the basis; one that does at this moment is noticed.
 *
 * # Safety
 * `basis` is NULL or points to a handle's memory.
 */
SinewStatus sinew_basis_close(struct SinewBasis *basis);

/**
 * Counts and identities.
 *
 * Errors: those of a handle; `STRUCT_SIZE`, `OVERLAP`.
 * Threads: any number at a time.
 *
 * # Safety
 * `basis` is NULL or a basis; `info` is NULL or as long as its first member says.
 */
SinewStatus sinew_basis_info(const struct SinewBasis *basis, struct SinewBasisInfo *info);

/**
 * The triangles: three vertex indices each, counter-clockwise from outside, source order.
 *
 * `indices` takes a pointer into the package, good as long as the package stands; `index_count` takes 3 F.
 *
 * Errors: those of a handle; `OVERLAP`.
 * Threads: any number at a time.
 *
 * # Safety
 * `basis` is NULL or a basis; the others are NULL or writable.
 */
SinewStatus sinew_basis_faces(const struct SinewBasis *basis,
                              const uint32_t **indices,
                              size_t *index_count);

/**
 * The name of a control, UTF-8, ended by NUL. `SINEW_NAME_BYTES` are always enough.
 *
 * Errors: those of a handle; `NO_SUCH_CONTROL`, `TOO_SHORT` (nothing was written), `OVERLAP`.
 * Threads: any number at a time.
 *
 * # Safety
 * `basis` is NULL or a basis; `name` is NULL or writable for `name_bytes`.
 */
SinewStatus sinew_control_name(const struct SinewBasis *basis,
                               uint32_t control,
                               char *name,
                               size_t name_bytes);

/**
 * The control of this name, which ends with NUL. Takes time in proportion to the number of controls.
 *
 * Errors: those of a handle; `NO_SUCH_NAME`, `OVERLAP`.
 * Threads: any number at a time.
 *
 * # Safety
 * `basis` is NULL or a basis; `name` is NULL or readable up to its NUL; `control` is NULL or writable.
 */
SinewStatus sinew_control_find(const struct SinewBasis *basis,
                               const char *name,
                               uint32_t *control);

/**
 * The stops of a control: `minimum <= 0 <= maximum`, the range seen in training. 0 is at rest.
 *
 * `minimum`, `maximum`: NULL where not wanted.
 *
 * Errors: those of a handle; `NO_SUCH_CONTROL`, `OVERLAP`.
 * Threads: any number at a time.
 *
 * # Safety
 * `basis` is NULL or a basis; the others are NULL or writable.
 */
SinewStatus sinew_control_range(const struct SinewBasis *basis,
                                uint32_t control,
                                float *minimum,
                                float *maximum);

/**
 * Where a control stands in the tree of components.
 *
 * `parent` takes the control above it, or `SINEW_NONE` for a coarse one; `level` takes 0 for coarse ones, 1 for their
 * children and so on. Either may be NULL where not wanted.
 *
 * Errors: those of a handle; `NO_SUCH_CONTROL`, `OVERLAP`.
 * Threads: any number at a time.
 *
 * # Safety
 * `basis` is NULL or a basis; the others are NULL or writable.
 */
SinewStatus sinew_control_parent(const struct SinewBasis *basis,
                                 uint32_t control,
                                 uint32_t *parent,
                                 uint32_t *level);

/**
 * How much memory a workspace for this basis needs.
 *
 * Errors: those of a handle; `OVERLAP`.
 * Threads: any number at a time.
 *
 * # Safety
 * `basis` is NULL or a basis; `layout` is NULL or writable.
 */
SinewStatus sinew_workspace_layout(const struct SinewBasis *basis, struct SinewLayout *layout);

/**
 * Makes a workspace, at rest.
 *
 * `memory`, `memory_bytes`: at least what `sinew_workspace_layout` says; what lies beyond that stays untouched.
 * `workspace`: takes the handle, which lies at `memory`.
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Errors: those of a handle; `TOO_SHORT`, `TOO_LONG`, `OVERLAP`, `STRUCT_SIZE`.
 * Threads: any number at a time, each with `memory` of its own.
 *
 * # Safety
 * `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths. `memory` stays in place, and is
 * written by nobody else, until the last use of the workspace.
 */
SinewStatus sinew_workspace_create(const struct SinewBasis *basis,
                                   uint8_t *memory,
                                   size_t memory_bytes,
                                   struct SinewWorkspace **workspace,
                                   struct SinewDetails *details);

/**
 * Ends a workspace: later calls with it are refused with `CLOSED_HANDLE` while its memory stands. There is nothing to
 * free, so this is optional before the memory is given back.
 *
 * Errors: those of a handle.
 * Threads: one at a time for each workspace; another one's use at this moment is noticed.
 *
 * # Safety
 * `workspace` is NULL or points to a handle's memory.
 */
SinewStatus sinew_workspace_close(struct SinewWorkspace *workspace);

/**
 * How much memory controls for this basis need: 12 bytes a control, and some for the handle.
 *
 * Errors: those of a handle; `OVERLAP`.
 * Threads: any number at a time.
 *
 * # Safety
 * `basis` is NULL or a basis; `layout` is NULL or writable.
 */
SinewStatus sinew_controls_layout(const struct SinewBasis *basis, struct SinewLayout *layout);

/**
 * Makes controls, all at rest.
 *
 * `memory`, `memory_bytes`: at least what `sinew_controls_layout` says; what lies beyond that stays untouched.
 * `controls`: takes the handle, which lies at `memory`.
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Errors: those of a handle; `TOO_SHORT`, `TOO_LONG`, `OVERLAP`, `STRUCT_SIZE`.
 * Threads: any number at a time, each with `memory` of its own.
 *
 * # Safety
 * `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths. `memory` stays in place, and is
 * written by nobody else, until the last use of the controls.
 */
SinewStatus sinew_controls_create(const struct SinewBasis *basis,
                                  uint8_t *memory,
                                  size_t memory_bytes,
                                  struct SinewControls **controls,
                                  struct SinewDetails *details);

/**
 * Ends controls: later calls with them are refused with `CLOSED_HANDLE` while their memory stands. There is nothing to
 * free, so this is optional before the memory is given back.
 *
 * Errors: those of a handle.
 * Threads: one at a time for each controls handle; another one's use at this moment is noticed.
 *
 * # Safety
 * `controls` is NULL or points to a handle's memory.
 */
SinewStatus sinew_controls_close(struct SinewControls *controls);

/**
 * Sets a control, clamped to its range. NaN and infinities are refused: an infinite knob is a fault, not a wish for the
 * stop.
 *
 * `taken`: NULL, or takes the weight after clamping.
 *
 * Errors: those of a handle; `NO_SUCH_CONTROL`, `NOT_FINITE`, `OVERLAP`.
 * Threads: one at a time for each controls handle; another one's use at this moment is noticed.
 *
 * # Safety
 * `controls` is NULL or controls; `taken` is NULL or writable.
 */
SinewStatus sinew_control_set(struct SinewControls *controls,
                              uint32_t control,
                              float weight,
                              float *taken);

/**
 * Sets a control beyond its stops, where a pose may leave what was seen in training.
 *
 * Errors: those of a handle; `NO_SUCH_CONTROL`, `NOT_FINITE`.
 * Threads: one at a time for each controls handle; another one's use at this moment is noticed.
 *
 * # Safety
 * `controls` is NULL or controls.
 */
SinewStatus sinew_control_set_unclamped(struct SinewControls *controls,
                                        uint32_t control,
                                        float weight);

/**
 * The weight of a control.
 *
 * Errors: those of a handle; `NO_SUCH_CONTROL`, `OVERLAP`.
 * Threads: one at a time for each controls handle; another one's use at this moment is noticed.
 *
 * # Safety
 * `controls` is NULL or controls; `weight` is NULL or writable.
 */
SinewStatus sinew_control_get(const struct SinewControls *controls,
                              uint32_t control,
                              float *weight);

/**
 * Sets all controls at once, each clamped to its range; for animation that comes as arrays.
 *
 * `weights`, `weight_count`: exactly K.
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Errors: those of a handle; `TOO_SHORT`, `NO_SUCH_CONTROL` (more than K), `NOT_FINITE` (none is set),
 * `OVERLAP`, `STRUCT_SIZE`.
 * Threads: one at a time for each controls handle; another one's use at this moment is noticed.
 *
 * # Safety
 * `controls` is NULL or controls; `weights` is NULL or readable for `weight_count` floats.
 */
SinewStatus sinew_controls_set_all(struct SinewControls *controls,
                                   const float *weights,
                                   size_t weight_count,
                                   struct SinewDetails *details);

/**
 * All weights, in order.
 *
 * `weights`, `weight_count`: at least K; more stay untouched.
 *
 * Errors: those of a handle; `TOO_SHORT`, `TOO_LONG`, `OVERLAP`.
 * Threads: one at a time for each controls handle; another one's use at this moment is noticed.
 *
 * # Safety
 * `controls` is NULL or controls; `weights` is NULL or writable for `weight_count` floats.
 */
SinewStatus sinew_controls_get_all(const struct SinewControls *controls,
                                   float *weights,
                                   size_t weight_count);

/**
 * All controls to rest.
 *
 * Errors: those of a handle.
 * Threads: one at a time for each controls handle; another one's use at this moment is noticed.
 *
 * # Safety
 * `controls` is NULL or controls.
 */
SinewStatus sinew_controls_reset(struct SinewControls *controls);

/**
 * Plays one frame: the rest shape deformed by the controls.
 *
 * `basis`, `workspace`, `controls`: made for the same content. Positions, normals, options, report, details, package and
 * the memory of the handles must not overlap.
 * `options`: where to write.
 * `report`: NULL, or takes what the frame had to do.
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Allocates nothing and waits for nothing. Components at rest are skipped; where no control moved since the workspace's last
 * frame, only the outputs are written.
 *
 * Errors: those of a handle; `FOREIGN_WORKSPACE`, `FOREIGN_CONTROLS`, `TOO_SHORT`, `TOO_LONG`, `OVERLAP`,
 * `STRUCT_SIZE`, `UNKNOWN_OPTION`, `NOT_FINITE` (something wrote over the weights), `FRAME_OVERFLOW` (then positions and
 * normals are those of the rest shape).
 * Threads: any number at a time for one basis; one at a time for each workspace and each controls handle, and another
 * one's use at this moment is noticed.
 *
 * # Safety
 * The handles are NULL or handles of their kind; the others are NULL or point to memory of the stated lengths.
 */
SinewStatus sinew_frame(const struct SinewBasis *basis,
                        struct SinewWorkspace *workspace,
                        const struct SinewControls *controls,
                        const struct SinewFrameOptions *options,
                        struct SinewFrameReport *report,
                        struct SinewDetails *details);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SINEW_H */
