/* Sinew for C: plays learned deformation components. A baked package holds a mesh and its components; controls move them; a
 * frame writes the deformed positions and normals.
 *
 * Written by cbindgen from runtime/capi/src: change that, not this file. Beside it: sinew_pins.h (drag vertices with the
 * mouse), sinew_batch.h (many instances on threads of yours), sinew_bones.h (bones for a GPU to skin by), sinew_knobs.h (boxes
 * of knobs).
 *
 * A pose
 *   SinewDetails details = SINEW_INIT(SinewDetails);
 *   SinewPlayer player = SINEW_INIT(SinewPlayer);
 *   SinewFrameOptions frame = SINEW_INIT(SinewFrameOptions);
 *   SinewLayout layout;
 *   sinew_player_layout(bytes, length, NULL, &layout, &details);        // then memory of that size, at that alignment
 *   sinew_player_open(SINEW_ABI_VERSION, bytes, length, NULL, memory, layout.size_bytes, &player, &details);
 *   sinew_control_set(player.controls, 0, 0.5f, NULL);
 *   frame.positions = positions;                                        // 3 floats a vertex
 *   frame.position_floats = 3 * (size_t)player.vertex_count;
 *   sinew_frame(player.basis, player.workspace, player.controls, &frame, NULL, &details);
 *
 * A player is a basis (the opened package), a workspace (what one posed mesh needs) and controls in one block of memory. Where
 * many meshes share a package, open one basis and make a workspace and controls for each: sinew_basis_open,
 * sinew_workspace_create, sinew_controls_create.
 *
 * Memory
 *   All of it is yours. A layout call says how much a handle needs and how it is aligned; the handle then lies in that
 *   memory, and what lies beyond its size stays untouched. Nothing is ever allocated, so there is nothing to free: give the
 *   memory back when the last use is over. Until then a handle's memory and the package's bytes stay in place, and nobody
 *   else writes them. Workspaces, controls and pins may outlive a basis: open the same content again, anywhere, and they go
 *   on. Handles that were closed, moved, written over or confused are refused by marks in their memory; memory that was
 *   freed is found by these marks only with luck. Nothing that a call writes may overlap anything else that it uses.
 *
 * Faults
 *   Every call returns a status. Unless the status says otherwise, a call that does not return SINEW_STATUS_OK has changed
 *   nothing, results included. `details` takes the numbers and a sentence; it may be NULL. "Errors" lists statuses, without
 *   SINEW_STATUS_, that a call has besides the usual ones: for its pointers and memory NULL_POINTER, MISALIGNED, TOO_SHORT,
 *   TOO_LONG, OVERLAP and STRUCT_SIZE; for its handles NOT_A_HANDLE, WRONG_HANDLE, CLOSED_HANDLE, MOVED_HANDLE,
 *   DAMAGED_HANDLE and IN_USE; INTERNAL for a defect of the library. A pointer may be NULL where its length is 0.
 *
 * Threads
 *   There is no global state, and no call waits or takes a lock. A basis and a batch serve any number of threads; any other
 *   handle one call at a time. A second call at the same moment is refused with IN_USE; making a handle in memory that is in
 *   use is not noticed.
 *
 * Structs
 *   Begin with SINEW_INIT: it sets the first member to the struct's size and the rest to zero, which means "as usual", so
 *   that structs can grow. Of structs in arrays the size is given beside the array. Choices are numbers of 32 bits that the
 *   enum of the same name lists.
 *
 * Build (Linux; `cargo build --release -p sinew-capi` makes the library)
 *   gcc -std=c99 -Iruntime/capi/include pose.c target/release/libsinew.a -lpthread -ldl -lm
 *   gcc -std=c99 -Iruntime/capi/include pose.c -Ltarget/release -lsinew -Wl,-rpath,target/release
 */

#ifndef SINEW_H
#define SINEW_H

#include <stddef.h>
#include <stdint.h>

/// Begins a struct that may grow: `SinewDetails details = SINEW_INIT(SinewDetails);`
#ifdef __cplusplus
template <typename T> inline T sinew_init() { T value = T(); value.struct_bytes = sizeof(T); return value; }
#define SINEW_INIT(T) sinew_init<T>()
#else
#define SINEW_INIT(T) { .struct_bytes = sizeof(T) }
#endif

/// What a call returns. Treat a code that is not listed as a fault: more may be added.
typedef int32_t SinewStatus;
enum {
  SINEW_STATUS_OK = 0, ///< done
  SINEW_STATUS_NULL_POINTER = 1, ///< a pointer that must not be NULL is
  SINEW_STATUS_MISALIGNED = 2, ///< a pointer does not start at a multiple of the alignment it needs
  SINEW_STATUS_TOO_SHORT = 3, ///< memory or a buffer is shorter than it must be
  SINEW_STATUS_TOO_LONG = 4, ///< a length reaches beyond the address space
  SINEW_STATUS_OVERLAP = 5, ///< memory that the call writes overlaps other memory that it uses
  SINEW_STATUS_STRUCT_SIZE = 6, ///< a struct's first member is not its size; begin with SINEW_INIT
  SINEW_STATUS_UNKNOWN_OPTION = 7, ///< a struct asks for something that this library is too old for
  SINEW_STATUS_WRONG_ABI = 8, ///< header and library have different interface versions
  SINEW_STATUS_PACKAGE_REFUSED = 9, ///< the package does not open; the details say why
  SINEW_STATUS_NOT_A_HANDLE = 10, ///< not a handle, or its memory was freed or written over
  SINEW_STATUS_WRONG_HANDLE = 11, ///< a handle of another kind
  SINEW_STATUS_CLOSED_HANDLE = 12, ///< the handle was closed, or a call that wrote it ended with INTERNAL
  SINEW_STATUS_MOVED_HANDLE = 13, ///< the handle was copied or moved; make it anew where it shall stay
  SINEW_STATUS_DAMAGED_HANDLE = 14, ///< something wrote over the handle's memory
  SINEW_STATUS_IN_USE = 15, ///< another thread is using the handle at this moment
  SINEW_STATUS_FOREIGN_WORKSPACE = 16, ///< the workspace was made for another basis; make one for this basis
  SINEW_STATUS_FOREIGN_CONTROLS = 17, ///< the controls were made for another basis; make some for this basis
  SINEW_STATUS_FOREIGN_PINS = 18, ///< the pins were made for another basis; make some for this basis
  SINEW_STATUS_NO_SUCH_CONTROL = 20, ///< there is no control of this index
  SINEW_STATUS_NO_SUCH_NAME = 21, ///< there is no control of this name
  SINEW_STATUS_NOT_FINITE = 22, ///< a number is NaN or infinite; what it was meant for stays as it was
  SINEW_STATUS_FRAME_OVERFLOW = 23, ///< the weights are so large that a position or a bone left f32; outputs and workspace are at rest
  SINEW_STATUS_NO_BONES = 24, ///< the package has no bones; bake it with some, or use the exact tier
  SINEW_STATUS_NEEDS_EXACT_TIER = 25, ///< the call needs a workspace of the exact tier
  SINEW_STATUS_NEEDS_BONES = 26, ///< the call needs a workspace of the bones
  SINEW_STATUS_NO_SUCH_VERTEX = 30, ///< there is no vertex of this index
  SINEW_STATUS_ALREADY_PINNED = 31, ///< the vertex is pinned already; move its target
  SINEW_STATUS_NOT_PINNED = 32, ///< the vertex is not pinned
  SINEW_STATUS_PINS_FULL = 33, ///< as many vertices are pinned as there is room for
  SINEW_STATUS_PIN_OVERFLOW = 34, ///< the weights are so large that a pinned vertex left f32; the controls stay
  SINEW_STATUS_NO_NORMALS = 40, ///< normals or tangents are to be written and no normals were given
  SINEW_STATUS_NO_TEXTURE = 41, ///< the package has no texture coordinates, and so no tangents
  SINEW_STATUS_STRIDE_TOO_SHORT = 42, ///< the stride of an attribute is less than its size
  SINEW_STATUS_ATTRIBUTES_OVERLAP = 43, ///< two attributes overlap, or interleave with different strides
  SINEW_STATUS_NO_SUCH_INSTANCE = 50, ///< there is no instance of this index
  SINEW_STATUS_NO_SUCH_KNOB = 60, ///< there is no knob of this index
  SINEW_STATUS_NO_SUCH_PAGE = 61, ///< no binding is on this page
  SINEW_STATUS_BAD_READING = 62, ///< no knob says this: an unknown kind, or a number outside its range
  SINEW_STATUS_KNOB_TWICE = 63, ///< two knobs have one address
  SINEW_STATUS_BAD_CALIBRATION = 64, ///< the calibration of a knob leaves no range to turn in
  SINEW_STATUS_BAD_STEP = 65, ///< the step of a knob must be above 0 and at most 1
  SINEW_STATUS_TWO_HANDS = 66, ///< two bindings move one control on the same page
  SINEW_STATUS_BAD_TREE = 67, ///< the tree needs a coarse knob, and knobs that are there and that no binding has
  SINEW_STATUS_BAD_RESPONSE = 68, ///< a response has a number out of range, or limits that do not fit its control
  SINEW_STATUS_TOO_MANY = 69, ///< more knobs or bindings than a surface takes
  SINEW_STATUS_INTERNAL = 99, ///< a defect of the library, please report it; what the call was writing is closed
};

/// Version of this interface. Rises when a function, a struct or a status code changes its meaning; additions leave it.
#define SINEW_ABI_VERSION 1

/// Bytes of the sentence in `SinewDetails`, with the NUL.
#define SINEW_DETAILS_TEXT_BYTES 216

/// Bytes of a buffer that holds any control's name, with the NUL.
#define SINEW_NAME_BYTES 65

/// Stands where an index is absent: the parent of a coarse control.
#define SINEW_NONE UINT32_MAX

/// What can be done about a package that does not open.
typedef int32_t SinewPackageReason;
enum {
  /// No package was refused.
  SINEW_PACKAGE_REASON_NONE = 0,
  /// The bytes are something else.
  SINEW_PACKAGE_REASON_NOT_A_PACKAGE = 1,
  /// Of a format version, or of a kind, that this library does not know: update the library, or train and bake again.
  SINEW_PACKAGE_REASON_VERSION = 2,
  /// Sound, but not to be played: `sinew bake` makes a baked package of a compact one.
  SINEW_PACKAGE_REASON_WRONG_KIND = 3,
  /// Cut off or changed on its way: copy it again.
  SINEW_PACKAGE_REASON_DAMAGED = 4,
  /// Whole, but it breaks a rule of the format: what wrote it has a defect.
  SINEW_PACKAGE_REASON_RULE = 5,
};

/// The way round in which a triangle's corners are written.
typedef int32_t SinewWinding;
enum {
  /// As in the source: counter-clockwise, seen from outside.
  SINEW_WINDING_COUNTER_CLOCKWISE = 0,
  /// The other way: for engines whose front faces are clockwise, or for axes that mirror; not for both.
  SINEW_WINDING_CLOCKWISE = 1,
};

/// Which tier of a package a workspace plays.
typedef int32_t SinewTier;
enum {
  /// All vertices are solved for: what was trained.
  SINEW_TIER_EXACT = 0,
  /// A few affine maps are posed, and the vertices follow them: for engines that skin by themselves (`sinew_bones.h`), crowds
  /// and small devices. How far they are from the exact tier, `SinewBasisInfo` says.
  SINEW_TIER_BONES = 1,
};

/// What frames run on.
typedef int32_t SinewKernels;
enum {
  /// The widest of this machine.
  SINEW_KERNELS_WIDEST = 0,
  /// Those that give the same bits on every machine.
  SINEW_KERNELS_SCALAR = 1,
};

/// What a frame had to do.
typedef int32_t SinewFrameOutcome;
enum {
  /// The controls had moved: decoded and solved.
  SINEW_FRAME_OUTCOME_SOLVED = 1,
  /// The controls were those of the workspace's last frame: its solution was written out again.
  SINEW_FRAME_OUTCOME_UNCHANGED = 2,
};

/// How normals and tangents are written. Numbers have the byte order of the machine.
typedef int32_t SinewUnitEncoding;
enum {
  /// Floats: three for a normal (12 bytes), four for a tangent (16 bytes).
  SINEW_UNIT_ENCODING_FLOAT32 = 0,
  /// Four 16-bit integers, 32767 for 1; a normal's fourth is 0 (8 bytes).
  SINEW_UNIT_ENCODING_SNORM16 = 1,
  /// Four 8-bit integers, 127 for 1; a normal's fourth is 0 (4 bytes).
  SINEW_UNIT_ENCODING_SNORM8 = 2,
  /// Two unsigned 16-bit integers, 65535 for 1: the place on an unfolded octahedron, as Godot has it (4 bytes). A tangent's second
  /// number holds the sign, too: in its upper half plus, in its lower half, turned over, minus.
  SINEW_UNIT_ENCODING_OCTAHEDRAL16 = 3,
};

/// An opened package. Refers to the package's bytes.
typedef struct SinewBasis SinewBasis;

/// One weight a component, 0 at rest.
typedef struct SinewControls SinewControls;

/// The buffers of one frame at a time: about 113 bytes a vertex, or 128 a bone. One for every mesh that
/// is posed on its own; any number may share a basis.
typedef struct SinewWorkspace SinewWorkspace;

/// How much memory a handle needs. Fixed for ever, hence without a size of its own.
typedef struct SinewLayout {
  /// Bytes: a multiple of the alignment.
  size_t size_bytes;
  /// The memory must start at a multiple of this: a power of two, at most 64.
  size_t alignment;
} SinewLayout;

/// Why a call was refused: written when a call returns anything but `SINEW_STATUS_OK`, else left alone.
typedef struct SinewDetails {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// Index of the element at fault: control, vertex, element of a package's field. 0 where the fault has none.
  uint64_t index;
  /// What was needed: a length, a count, a limit, a version. 0 where the fault has none.
  uint64_t expected;
  /// What was found instead. 0 where the fault has none.
  uint64_t actual;
  /// The status that the call returned.
  SinewStatus status;
  /// Why a package does not open.
  SinewPackageReason reason;
  /// One English sentence for a log, UTF-8, ended by NUL; cut off if it is too long.
  char text[SINEW_DETAILS_TEXT_BYTES];
} SinewDetails;

/// What a package holds.
typedef struct SinewBasisInfo {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// V: elements of positions and normals.
  uint32_t vertex_count;
  /// F: triangles.
  uint32_t face_count;
  /// K: controls, one a component.
  uint32_t control_count;
  /// Levels of components, coarse to fine; at least 1.
  uint32_t level_count;
  /// Identity of the content: packages with the same one play the same.
  uint8_t content_id[16];
  /// Identity of the compact package that this one was baked from.
  uint8_t compact_id[16];
  /// R: vertices that an engine draws, split where texture coordinates do; V where the package has none.
  uint32_t render_vertex_count;
  /// Whether the package has texture coordinates: 0 or 1.
  uint32_t has_texture;
  /// B: bones of the package; 0: it has none, and what follows is 0.
  uint32_t bone_count;
  /// Bones that a vertex follows at most: 4 or 8.
  uint32_t bone_influences;
  /// Root mean square distance of the bones from the exact tier, half of the controls anywhere within 70 % of their ranges,
  /// as a share of the diagonal of the rest shape's bounding box; measured when the package was baked.
  float bone_error_rms;
  /// Greatest such distance.
  float bone_error_max;
  /// Root mean square angle between the normals of both tiers in those poses, radians.
  float bone_error_normals;
  /// Whether the package has the exact tier: 0 or 1. Without it workspaces play the bones, and nothing can be held.
  uint32_t has_exact_tier;
} SinewBasisInfo;

/// What a workspace is for. Zero everywhere is the exact tier on the widest kernels.
typedef struct SinewWorkspaceOptions {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// Which tier it plays.
  SinewTier tier;
  /// What it runs on.
  SinewKernels kernels;
} SinewWorkspaceOptions;

/// All that plays one mesh: handles that lie in one block.
typedef struct SinewPlayer {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// The opened package.
  SinewBasis *basis;
  /// At rest.
  SinewWorkspace *workspace;
  /// All at rest.
  SinewControls *controls;
  /// V: elements of positions and normals.
  uint32_t vertex_count;
  /// K: controls, one a component.
  uint32_t control_count;
} SinewPlayer;

/// Where a frame writes.
typedef struct SinewFrameOptions {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// Takes the deformed positions, xyz for each vertex, source order, units of the source. Not NULL.
  float *positions;
  /// Floats that `positions` has room for: at least 3 V; more stay untouched.
  size_t position_floats;
  /// Takes unit vertex normals, xyz for each vertex, source order. NULL where not wanted.
  float *normals;
  /// Floats that `normals` has room for: at least 3 V; more stay untouched.
  size_t normal_floats;
} SinewFrameOptions;

/// What a frame tells besides its buffers.
typedef struct SinewFrameReport {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// What the frame had to do.
  SinewFrameOutcome outcome;
  /// Box around the positions, its least corner.
  float minimum[3];
  /// Its greatest corner.
  float maximum[3];
} SinewFrameReport;

/// What is written for every render vertex, and where: element r of an attribute begins at byte
/// `offset + r * stride` of `bytes`. An attribute whose stride is 0 is not written.
typedef struct SinewVertexOptions {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// Of a frame: xyz for each vertex, source order. Not NULL.
  const float *positions;
  /// Floats of `positions`: at least 3 V.
  size_t position_floats;
  /// Of the same frame; NULL where neither normals nor tangents are written.
  const float *normals;
  /// Floats of `normals`: at least 3 V.
  size_t normal_floats;
  /// The vertex buffer. Bytes that belong to no attribute stay as they are; no alignment is asked for.
  void *bytes;
  /// Bytes of the vertex buffer.
  size_t byte_count;
  /// Memory for tangents, 4 floats a render vertex, at a multiple of 4; NULL where none are written.
  float *scratch;
  /// Floats of `scratch`.
  size_t scratch_floats;
  /// First byte of the first position: three floats, 12 bytes.
  size_t position_offset;
  /// Bytes from one position to the next.
  size_t position_stride;
  /// First byte of the first normal.
  size_t normal_offset;
  /// Bytes from one normal to the next.
  size_t normal_stride;
  /// First byte of the first tangent: along the texture's u, and the sign of the bitangent.
  size_t tangent_offset;
  /// Bytes from one tangent to the next.
  size_t tangent_stride;
  /// First byte of the first texture coordinates: two floats, 8 bytes. They do not move: once is enough.
  size_t texture_offset;
  /// Bytes from one pair of texture coordinates to the next.
  size_t texture_stride;
  /// Of normals and tangents.
  SinewUnitEncoding encoding;
} SinewVertexOptions;

/// A box. Fixed for ever, hence without a size of its own.
typedef struct SinewBounds {
  /// Its least corner.
  float minimum[3];
  /// Its greatest corner.
  float maximum[3];
} SinewBounds;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/// The library's version, for example "0.1.0". Never NULL, never freed.
const char *sinew_version(void);

/// The interface version that the library was built with; `SINEW_ABI_VERSION` is that of the header. The functions that open
/// something compare the two.
uint32_t sinew_abi_version(void);

/// Ends a handle of any kind: later calls with it are refused with `CLOSED_HANDLE` while its memory stands. There is nothing
/// to free, so this is optional before memory and package are given back.
SinewStatus sinew_close(void *handle);

/// What a status means, in one English sentence without a full stop. Never NULL, never freed, unknown codes included.
const char *sinew_status_text(int32_t status);

/// The name of a status as this header spells it, for logs. Never NULL, never freed, unknown codes included.
const char *sinew_status_name(int32_t status);

/// How much memory a basis needs; the same for every package.
SinewStatus sinew_basis_layout(SinewLayout *layout);

/// Opens a baked package: every check that costs more than a few comparisons is here, and no later call can fail because
/// of the package. Copies nothing. Some milliseconds for some ten thousand vertices.
///
/// `abi_version`: pass `SINEW_ABI_VERSION`.
/// `bytes`, `length`: the whole package, at a multiple of 16; frames are fastest where it is one of 64.
///
/// Opening again in the same memory is allowed when nothing uses the old handle.
///
/// Errors: `WRONG_ABI`, `PACKAGE_REFUSED`.
SinewStatus sinew_basis_open(uint32_t abi_version, const void *bytes, size_t length, void *memory, size_t memory_bytes,
                             SinewBasis **basis, SinewDetails *details);

/// Counts and identities.
SinewStatus sinew_basis_info(const SinewBasis *basis, SinewBasisInfo *info);

/// The triangles by vertices: three indices each, in the order of the source.
///
/// `indices`, `index_count`: take 3 F.
///
/// Errors: `UNKNOWN_OPTION`.
SinewStatus sinew_basis_faces(const SinewBasis *basis, SinewWinding winding, uint32_t *indices, size_t index_count);

/// The triangles by render vertices, which `sinew_vertices_write` writes: what an engine draws.
///
/// `indices`, `index_count`: take 3 F.
///
/// Errors: `UNKNOWN_OPTION`.
SinewStatus sinew_basis_render_faces(const SinewBasis *basis, SinewWinding winding, uint32_t *indices,
                                     size_t index_count);

/// The name of a control, UTF-8, ended by NUL. `SINEW_NAME_BYTES` are always enough.
///
/// Errors: `NO_SUCH_CONTROL`.
SinewStatus sinew_control_name(const SinewBasis *basis, uint32_t control, char *name, size_t name_bytes);

/// The control of this name, which ends with NUL. Looks at one name after the other.
///
/// Errors: `NO_SUCH_NAME`.
SinewStatus sinew_control_find(const SinewBasis *basis, const char *name, uint32_t *control);

/// The stops of a control: `minimum <= 0 <= maximum`, the range seen in training. 0 is at rest.
///
/// `minimum`, `maximum`: NULL where not wanted.
///
/// Errors: `NO_SUCH_CONTROL`.
SinewStatus sinew_control_range(const SinewBasis *basis, uint32_t control, float *minimum, float *maximum);

/// Where a control stands in the tree of components.
///
/// `parent` takes the control above it, or `SINEW_NONE` for a coarse one; `level` takes 0 for coarse ones, 1 for their
/// children and so on. Either may be NULL where not wanted.
///
/// Errors: `NO_SUCH_CONTROL`.
SinewStatus sinew_control_parent(const SinewBasis *basis, uint32_t control, uint32_t *parent, uint32_t *level);

/// How much memory controls for this basis need: 12 bytes a control, and some for the handle.
SinewStatus sinew_controls_layout(const SinewBasis *basis, SinewLayout *layout);

/// Makes controls, all at rest.
SinewStatus sinew_controls_create(const SinewBasis *basis, void *memory, size_t memory_bytes, SinewControls **controls,
                                  SinewDetails *details);

/// Sets a control, clamped to its range. An infinite knob is a fault, not a wish for the stop.
///
/// `taken`: NULL, or takes the weight after clamping.
///
/// Errors: `NO_SUCH_CONTROL`, `NOT_FINITE`.
SinewStatus sinew_control_set(SinewControls *controls, uint32_t control, float weight, float *taken);

/// Sets a control beyond its stops, where a pose may leave what was seen in training.
///
/// Errors: `NO_SUCH_CONTROL`, `NOT_FINITE`.
SinewStatus sinew_control_set_unclamped(SinewControls *controls, uint32_t control, float weight);

/// The weight of a control.
///
/// Errors: `NO_SUCH_CONTROL`.
SinewStatus sinew_control_get(const SinewControls *controls, uint32_t control, float *weight);

/// Sets all controls at once, each clamped to its range; for animation that comes as arrays.
///
/// `weights`, `weight_count`: exactly K.
///
/// Errors: `NO_SUCH_CONTROL` (more than K), `NOT_FINITE` (none is set).
SinewStatus sinew_controls_set_all(SinewControls *controls, const float *weights, size_t weight_count,
                                   SinewDetails *details);

/// All weights, in order.
///
/// `weights`, `weight_count`: at least K; more stay untouched.
SinewStatus sinew_controls_get_all(const SinewControls *controls, float *weights, size_t weight_count);

/// All controls to rest.
SinewStatus sinew_controls_reset(SinewControls *controls);

/// Carries weights over by name when a package is exchanged: each control of `to` that has a namesake in `from` takes its
/// weight, clamped to the new range; the others stay. Play a frame with a new workspace, then close what was there before.
///
/// `from_basis`, `from`: what was played until now. `to_basis`, `to`: what takes its place.
/// `carried`: NULL, or takes how many controls had a namesake.
///
/// Errors: `FOREIGN_CONTROLS`, `NOT_FINITE` (something wrote over the weights).
SinewStatus sinew_controls_carry(const SinewBasis *from_basis, const SinewControls *from, const SinewBasis *to_basis,
                                 SinewControls *to, uint32_t *carried);

/// How much memory a workspace needs for this basis.
///
/// `options`: NULL for the exact tier.
///
/// Errors: `NO_BONES`, `UNKNOWN_OPTION`.
SinewStatus sinew_workspace_layout(const SinewBasis *basis, const SinewWorkspaceOptions *options, SinewLayout *layout);

/// Makes a workspace, at rest.
///
/// `options`: NULL for the exact tier.
///
/// Errors: `NO_BONES`, `UNKNOWN_OPTION`.
SinewStatus sinew_workspace_create(const SinewBasis *basis, const SinewWorkspaceOptions *options, void *memory,
                                   size_t memory_bytes, SinewWorkspace **workspace, SinewDetails *details);

/// How much memory a player of this package needs. Takes as long as `sinew_player_open`: it checks the package.
///
/// `bytes`, `length`: the whole package, at a multiple of 16; frames are fastest where it is one of 64.
/// `options`: NULL for the exact tier.
///
/// Errors: `PACKAGE_REFUSED`, `NO_BONES`, `UNKNOWN_OPTION`.
SinewStatus sinew_player_layout(const void *bytes, size_t length, const SinewWorkspaceOptions *options,
                                SinewLayout *layout, SinewDetails *details);

/// Opens a package and makes a workspace and controls for it, all in one block.
///
/// `abi_version`: pass `SINEW_ABI_VERSION`.
/// `bytes`, `length`, `options`: as for `sinew_player_layout`.
///
/// Errors: `WRONG_ABI`, `PACKAGE_REFUSED`, `NO_BONES`, `UNKNOWN_OPTION`.
SinewStatus sinew_player_open(uint32_t abi_version, const void *bytes, size_t length,
                              const SinewWorkspaceOptions *options, void *memory, size_t memory_bytes,
                              SinewPlayer *player, SinewDetails *details);

/// Plays one frame: the rest shape deformed by the controls, on the tier that the workspace was made for.
///
/// `basis`, `workspace`, `controls`: made for the same content.
/// `report`: NULL, or takes what the frame had to do.
///
/// Waits for nothing. Components at rest are skipped; where no control moved since the workspace's last frame, only the outputs
/// are written.
///
/// Errors: `FOREIGN_WORKSPACE`, `FOREIGN_CONTROLS`, `UNKNOWN_OPTION`, `NOT_FINITE` (something wrote over the weights),
/// `FRAME_OVERFLOW` (then positions and normals are those of the rest shape).
SinewStatus sinew_frame(const SinewBasis *basis, SinewWorkspace *workspace, const SinewControls *controls,
                        const SinewFrameOptions *options, SinewFrameReport *report, SinewDetails *details);

/// Writes the vertices of a frame into a vertex buffer: `render_vertex_count` of them, those of `sinew_basis_render_faces`.
/// For buffers in separate memory call it once for each.
///
/// `bounds`: NULL, or takes the box around all positions.
///
/// Errors: `NO_NORMALS`, `NO_TEXTURE`, `STRIDE_TOO_SHORT`, `ATTRIBUTES_OVERLAP`, `UNKNOWN_OPTION`.
SinewStatus sinew_vertices_write(const SinewBasis *basis, const SinewVertexOptions *options, SinewBounds *bounds,
                                 SinewDetails *details);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SINEW_H */
