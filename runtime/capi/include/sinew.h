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
 * Knobs: the port is yours, and so is its clock. Bytes come out of it, readings out of those, weights out of those.
 *   sinew_decoder_open       once for each device; it finds out what the device speaks
 *   sinew_surface_create     once for each device: which knob moves what; by default the knobs follow the tree
 *   sinew_decoder_feed       whenever the port has bytes, then until nothing waits:
 *   sinew_decoder_next       a reading, for
 *   sinew_surface_take       which remembers it
 *   sinew_surface_advance    each frame, before sinew_frame: moves the controls
 *
 * More
 *   sinew_workspace_create_for   a workspace of the fast tier, for crowds and small devices
 *   sinew_vertices_write         a frame as a vertex buffer: strides, offsets, tangents, texture coordinates
 *   sinew_handles_add, sinew_drag   the weights that bring held vertices to where the mouse wants them
 *   sinew_batch_play             many instances on threads of yours
 *
 * Memory
 *   All of it is yours. A layout call says how much a handle needs and how it is aligned; the handle then lies in that
 *   memory. Nothing is ever allocated, so there is nothing to free: give the memory back when the last use is over.
 *   These must stay in place, and be written by nobody else:
 *     the package's bytes    until the last use of the basis and of surfaces made for it
 *     the basis's memory     until the last use of the basis
 *     a workspace's memory   until the last use of the workspace
 *     the controls' memory   until the last use of the controls
 *   and likewise that of decoders, surfaces, handles and batches.
 *   Workspaces, controls and handles may outlive a basis: open the same content again, anywhere, and they go on. With other
 *   content they are refused. Handles that were closed, moved, written over or confused are refused too, by marks in their
 *   memory; memory that was freed is found by these marks only with luck.
 *
 * Faults
 *   Every call returns a status. Unless the status says otherwise, a call that does not return SINEW_STATUS_OK has
 *   changed nothing, results included. "Errors" lists the statuses without SINEW_STATUS_; every function that takes
 *   pointers also returns NULL_POINTER, MISALIGNED and, for a defect of the library, INTERNAL. "Those of a handle" are
 *   NOT_A_HANDLE, WRONG_HANDLE, CLOSED_HANDLE, MOVED_HANDLE, DAMAGED_HANDLE and IN_USE.
 *
 * Threads
 *   There is no global state. A basis serves any number of threads, and so does a batch; any other handle one call at a
 *   time. A second call at the same moment is refused with IN_USE; making a handle in memory that is in use is not noticed.
 *
 * Structs
 *   Their first member is their own size: set it to sizeof. Zero in the others means "as usual", so that structs can grow.
 *   Of structs in arrays the size is given beside the array. Choices are numbers of the enum that a member's text names.
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
 * Vertices held at once, at most.
 */
#define SINEW_HANDLES_MAX 64

/**
 * Bytes of a buffer that holds any knob's name, with the NUL.
 */
#define SINEW_KNOB_NAME_BYTES 33

/**
 * Bytes of a sentence about a decoder, with the NUL.
 */
#define SINEW_DECODER_TEXT_BYTES 120

/**
 * Bytes of what a firmware calls itself, with the NUL.
 */
#define SINEW_FIRMWARE_BYTES 40

/**
 * Readings that wait in a decoder, at most.
 */
#define SINEW_DECODER_READINGS 2048

/**
 * Knobs of a surface, at most.
 */
#define SINEW_KNOBS_MAX 128

/**
 * Bindings of a surface, at most.
 */
#define SINEW_BINDINGS_MAX 512

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
   * The package has no fast tier; `sinew bake` makes one.
   */
  SINEW_STATUS_NO_FAST_TIER = 24,
  /**
   * The workspace is of the fast tier, and the call needs one of the exact tier.
   */
  SINEW_STATUS_NEEDS_EXACT_TIER = 25,
  /**
   * The handles were made for other content than the basis has now.
   */
  SINEW_STATUS_FOREIGN_HANDLES = 26,
  /**
   * The index of a vertex is not less than their count.
   */
  SINEW_STATUS_NO_SUCH_VERTEX = 27,
  /**
   * The vertex is held already; give it a new target.
   */
  SINEW_STATUS_ALREADY_HELD = 28,
  /**
   * The vertex is not held.
   */
  SINEW_STATUS_NOT_HELD = 29,
  /**
   * As many vertices are held as there is room for.
   */
  SINEW_STATUS_HANDLES_FULL = 30,
  /**
   * The weights are so large that a held vertex left f32; the controls stay as they were.
   */
  SINEW_STATUS_HELD_OVERFLOW = 31,
  /**
   * Normals or tangents are to be written, and no normals were given.
   */
  SINEW_STATUS_NO_NORMALS = 32,
  /**
   * Tangents or texture coordinates are to be written, and the package has no texture coordinates.
   */
  SINEW_STATUS_NO_TEXTURE = 33,
  /**
   * The stride of an attribute is less than its size.
   */
  SINEW_STATUS_STRIDE_TOO_SHORT = 34,
  /**
   * Two attributes of a vertex would write into each other, or interleave with different strides.
   */
  SINEW_STATUS_ATTRIBUTES_OVERLAP = 35,
  /**
   * The index of an instance is not less than their count.
   */
  SINEW_STATUS_NO_SUCH_INSTANCE = 36,
  /**
   * The index of a knob is not less than their count.
   */
  SINEW_STATUS_NO_SUCH_KNOB = 40,
  /**
   * No binding is on this page.
   */
  SINEW_STATUS_NO_SUCH_PAGE = 41,
  /**
   * No knob says this: an unknown kind of reading, a value above its full scale, a number that does not fit.
   */
  SINEW_STATUS_BAD_READING = 42,
  /**
   * Two knobs have one address.
   */
  SINEW_STATUS_KNOB_TWICE = 43,
  /**
   * A knob's calibration leaves no range to turn in.
   */
  SINEW_STATUS_BAD_CALIBRATION = 44,
  /**
   * A knob's step is not above 0 and at most 1.
   */
  SINEW_STATUS_BAD_STEP = 45,
  /**
   * Two bindings move one control on the same page.
   */
  SINEW_STATUS_TWO_HANDS = 46,
  /**
   * The tree has no coarse knob, more knobs than there are, or one that a binding has too.
   */
  SINEW_STATUS_BAD_TREE = 47,
  /**
   * A number of a response is out of range, or its limits do not fit the control.
   */
  SINEW_STATUS_BAD_RESPONSE = 48,
  /**
   * More knobs or bindings than a surface takes.
   */
  SINEW_STATUS_TOO_MANY = 49,
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
 * How a decoder came to its protocol.
 */
enum SinewRecognition
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * The settings named it.
   */
  SINEW_RECOGNITION_NAMED = 1,
  /**
   * So few bytes came that nothing is said yet.
   */
  SINEW_RECOGNITION_LISTENING = 2,
  /**
   * Many bytes came and no protocol fits: a wrong baud rate, or a device of another kind. It goes on listening.
   */
  SINEW_RECOGNITION_UNDECIDED = 3,
  /**
   * The bytes told.
   */
  SINEW_RECOGNITION_FOUND = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewRecognition SinewRecognition;
#else
typedef int32_t SinewRecognition;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What a device speaks.
 */
enum SinewProtocol
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Not known. As a setting: the first bytes decide.
   */
  SINEW_PROTOCOL_UNKNOWN = 0,
  /**
   * Text lines of numbers: deej, CSV, Serial Plotter.
   */
  SINEW_PROTOCOL_LINES = 1,
  /**
   * Sinew's own framed packets, `docs/knob-protocol.md`.
   */
  SINEW_PROTOCOL_PACKETS = 2,
  /**
   * MIDI bytes.
   */
  SINEW_PROTOCOL_MIDI = 3,
  /**
   * Firmata analog reports.
   */
  SINEW_PROTOCOL_FIRMATA = 4,
  /**
   * OSC, in datagrams or in SLIP.
   */
  SINEW_PROTOCOL_OSC = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewProtocol SinewProtocol;
#else
typedef int32_t SinewProtocol;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Where a knob stands with what it should move.
 */
enum SinewTakeoverState
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * The knob moves nothing on this page.
   */
  SINEW_TAKEOVER_STATE_UNASSIGNED = 0,
  /**
   * The knob has not been heard of since it was plugged in.
   */
  SINEW_TAKEOVER_STATE_UNHEARD = 1,
  /**
   * Everything is held: unplugged, easing to rest, or stopped.
   */
  SINEW_TAKEOVER_STATE_HELD = 2,
  /**
   * The knob moves its control.
   */
  SINEW_TAKEOVER_STATE_ENGAGED = 3,
  /**
   * The knob must first be turned left, counter-clockwise, to pick its control up.
   */
  SINEW_TAKEOVER_STATE_TURN_LEFT = 4,
  /**
   * The knob must first be turned right.
   */
  SINEW_TAKEOVER_STATE_TURN_RIGHT = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewTakeoverState SinewTakeoverState;
#else
typedef int32_t SinewTakeoverState;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How MIDI controllers count.
 */
enum SinewMidiCoding
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Positions, 0 to 127.
   */
  SINEW_MIDI_CODING_ABSOLUTE = 0,
  /**
   * Steps in two's complement of seven bits: 1 is one clockwise, 127 one back.
   */
  SINEW_MIDI_CODING_TWOS_COMPLEMENT = 1,
  /**
   * Steps with a sign bit: 1 is one clockwise, 65 one back.
   */
  SINEW_MIDI_CODING_SIGNED_BIT = 2,
  /**
   * Steps around 64: 65 is one clockwise, 63 one back.
   */
  SINEW_MIDI_CODING_BINARY_OFFSET = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewMidiCoding SinewMidiCoding;
#else
typedef int32_t SinewMidiCoding;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Whether the MIDI controllers 0 to 31 have their lower seven bits in 32 to 63.
 */
enum SinewMidiPairing
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Learned a controller at a time.
   */
  SINEW_MIDI_PAIRING_LEARNED = 0,
  /**
   * All are pairs.
   */
  SINEW_MIDI_PAIRING_ALWAYS = 1,
  /**
   * None is.
   */
  SINEW_MIDI_PAIRING_NEVER = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewMidiPairing SinewMidiPairing;
#else
typedef int32_t SinewMidiPairing;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What a reading says.
 */
enum SinewReadingKind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Nothing waits.
   */
  SINEW_READING_KIND_NONE = 0,
  /**
   * The knob stands at `value` of `full_scale`.
   */
  SINEW_READING_KIND_POSITION = 1,
  /**
   * The knob was turned by `value` steps; clockwise is positive.
   */
  SINEW_READING_KIND_STEPS = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewReadingKind SinewReadingKind;
#else
typedef int32_t SinewReadingKind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What a knob does with a control that stands elsewhere.
 */
enum SinewTakeover
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * The control waits until the knob passes its place, however fast.
   */
  SINEW_TAKEOVER_PICKUP = 0,
  /**
   * The control goes to the knob at the knob's first move.
   */
  SINEW_TAKEOVER_JUMP = 1,
  /**
   * The control follows in proportion, so that both meet at an end.
   */
  SINEW_TAKEOVER_SCALE = 2,
  /**
   * The control moves as much as the knob.
   */
  SINEW_TAKEOVER_RELATIVE = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewTakeover SinewTakeover;
#else
typedef int32_t SinewTakeover;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Shape of the way from one end to the other. `curve_number` is the slope at the steep end over that at the flat one, above
 * 1, at most 1000; of an S curve the slope in the middle, 1 to 8.
 */
enum SinewCurve
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Equal turns, equal moves.
   */
  SINEW_CURVE_LINEAR = 0,
  /**
   * Fine at the start, coarse at the end.
   */
  SINEW_CURVE_EXPONENTIAL = 1,
  /**
   * Coarse at the start, fine at the end.
   */
  SINEW_CURVE_LOGARITHMIC = 2,
  /**
   * Fine at both ends.
   */
  SINEW_CURVE_S = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewCurve SinewCurve;
#else
typedef int32_t SinewCurve;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Where rest stands on a knob.
 */
enum SinewCentre
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * In the middle, with a detent of 3 % of the travel; where the control moves one way only, as `EVEN`.
   */
  SINEW_CENTRE_USUAL = 0,
  /**
   * The range is spread evenly; rest stands where it falls.
   */
  SINEW_CENTRE_EVEN = 1,
  /**
   * In the middle, with a detent of `detent`.
   */
  SINEW_CENTRE_REST = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewCentre SinewCentre;
#else
typedef int32_t SinewCentre;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What to do, as a button of the device would.
 */
enum SinewCommand
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Ease everything to rest and hold it there until `RELEASE`.
   */
  SINEW_COMMAND_STOP = 1,
  /**
   * End a stop: each control stays at rest until its knob picks it up.
   */
  SINEW_COMMAND_RELEASE = 2,
  /**
   * Next page: of the tree if there is one, of the bindings otherwise. The last is followed by the first.
   */
  SINEW_COMMAND_NEXT = 3,
  /**
   * Previous page.
   */
  SINEW_COMMAND_PREVIOUS = 4,
  /**
   * Tree: the children of the knob last turned take the coarse knobs.
   */
  SINEW_COMMAND_INTO = 5,
  /**
   * Tree: back up.
   */
  SINEW_COMMAND_OUT = 6,
  /**
   * Tree: next page of the fine knobs.
   */
  SINEW_COMMAND_NEXT_FINE = 7,
  /**
   * Tree: the children of the control in `argument` come onto the fine knobs.
   */
  SINEW_COMMAND_FOCUS = 8,
  /**
   * The page of the bindings in `argument`, from 0.
   */
  SINEW_COMMAND_PAGE = 9,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewCommand SinewCommand;
#else
typedef int32_t SinewCommand;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Which tier of a package a workspace plays.
 */
enum SinewTier
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * All vertices are solved for: what was trained.
   */
  SINEW_TIER_EXACT = 0,
  /**
   * A few nodes are solved for, and the vertices follow them: for crowds and small devices. How far it is from the exact
   * tier, `SinewBasisInfo` says.
   */
  SINEW_TIER_FAST = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewTier SinewTier;
#else
typedef int32_t SinewTier;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What frames run on.
 */
enum SinewKernels
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * The widest of this machine.
   */
  SINEW_KERNELS_WIDEST = 0,
  /**
   * Those that give the same bits on every machine.
   */
  SINEW_KERNELS_SCALAR = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewKernels SinewKernels;
#else
typedef int32_t SinewKernels;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How normals and tangents are written. Numbers have the byte order of the machine.
 */
enum SinewUnitEncoding
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Floats: three for a normal (12 bytes), four for a tangent (16 bytes).
   */
  SINEW_UNIT_ENCODING_FLOAT32 = 0,
  /**
   * Four 16-bit integers, 32767 for 1; a normal's fourth is 0 (8 bytes).
   */
  SINEW_UNIT_ENCODING_SNORM16 = 1,
  /**
   * Four 8-bit integers, 127 for 1; a normal's fourth is 0 (4 bytes).
   */
  SINEW_UNIT_ENCODING_SNORM8 = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SinewUnitEncoding SinewUnitEncoding;
#else
typedef int32_t SinewUnitEncoding;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * An opened package, in memory of yours. Refers to the package's bytes: keep both in place, unchanged, until the last
 * use of the basis.
 */
typedef struct SinewBasis SinewBasis;

/**
 * A round of frames over many instances, in memory of yours. The instances' handles and buffers stay in place until the
 * last use of the batch.
 */
typedef struct SinewBatch SinewBatch;

/**
 * One weight a component, 0 at rest, in memory of yours.
 */
typedef struct SinewControls SinewControls;

/**
 * Reads one device, whatever it speaks, in memory of yours.
 */
typedef struct SinewDecoder SinewDecoder;

/**
 * Held vertices, their targets, and the controls that dragging leaves alone, in memory of yours.
 */
typedef struct SinewHandles SinewHandles;

/**
 * One device's knobs on the controls of one basis, in memory of yours. Refers to the package's bytes as the basis does:
 * keep them in place, unchanged, until the last use of the surface.
 */
typedef struct SinewSurface SinewSurface;

/**
 * The buffers of one frame at a time, in memory of yours: about 96 bytes a vertex, a third of that in the fast tier. One
 * for every mesh that is posed on its own; any number may share a basis.
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
  /**
   * Nodes of the fast tier; 0: the package has none.
   */
  uint32_t fast_node_count;
  /**
   * R: vertices of the render mesh, split where texture coordinates do; V where the package has none.
   */
  uint32_t render_vertex_count;
  /**
   * Whether the package has texture coordinates: 0 or 1.
   */
  uint32_t has_texture;
  /**
   * Root mean square distance of the fast tier from the exact one in mixed poses, as a share of the diagonal of the
   * rest shape's bounding box; measured when the package was baked. 0 without fast tier.
   */
  float fast_error_rms;
  /**
   * Greatest such distance. 0 without fast tier.
   */
  float fast_error_max;
  /**
   * Root mean square angle between the normals of both tiers in those poses, radians. 0 without fast tier.
   */
  float fast_error_normals;
} SinewBasisInfo;

/**
 * What a workspace is for. Zero everywhere is the exact tier on the widest kernels.
 */
typedef struct SinewWorkspaceOptions {
  /**
   * `sizeof(SinewWorkspaceOptions)`.
   */
  size_t struct_bytes;
  /**
   * A `SinewTier`.
   */
  int32_t tier;
  /**
   * A `SinewKernels`.
   */
  int32_t kernels;
} SinewWorkspaceOptions;

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
  /**
   * Box around the positions, its least corner.
   */
  float minimum[3];
  /**
   * Its greatest corner.
   */
  float maximum[3];
} SinewFrameReport;

/**
 * What is written for every render vertex, and where: element r of an attribute begins at byte
 * `offset + r * stride` of `bytes`. Start from zeros: an attribute whose stride is 0 is not written.
 */
typedef struct SinewVertexOptions {
  /**
   * `sizeof(SinewVertexOptions)`.
   */
  size_t struct_bytes;
  /**
   * Of a frame: xyz for each vertex, source order. Not NULL.
   */
  const float *positions;
  /**
   * Floats of `positions`: at least 3 V.
   */
  size_t position_floats;
  /**
   * Of the same frame; NULL where neither normals nor tangents are written.
   */
  const float *normals;
  /**
   * Floats of `normals`: at least 3 V.
   */
  size_t normal_floats;
  /**
   * The vertex buffer. Bytes that belong to no attribute stay as they are; no alignment is asked for.
   */
  uint8_t *bytes;
  /**
   * Bytes of the vertex buffer.
   */
  size_t byte_count;
  /**
   * Memory for tangents, 4 floats a render vertex, at a multiple of 4; NULL where none are written.
   */
  float *scratch;
  /**
   * Floats of `scratch`.
   */
  size_t scratch_floats;
  /**
   * First byte of the first position: three floats, 12 bytes.
   */
  size_t position_offset;
  /**
   * Bytes from one position to the next.
   */
  size_t position_stride;
  /**
   * First byte of the first normal.
   */
  size_t normal_offset;
  /**
   * Bytes from one normal to the next.
   */
  size_t normal_stride;
  /**
   * First byte of the first tangent: along the texture's u, and the sign of the bitangent.
   */
  size_t tangent_offset;
  /**
   * Bytes from one tangent to the next.
   */
  size_t tangent_stride;
  /**
   * First byte of the first texture coordinates: two floats, 8 bytes. They do not move: once is enough.
   */
  size_t texture_offset;
  /**
   * Bytes from one pair of texture coordinates to the next.
   */
  size_t texture_stride;
  /**
   * A `SinewUnitEncoding`, of normals and tangents.
   */
  int32_t encoding;
} SinewVertexOptions;

/**
 * A box. Fixed for ever, hence without a size of its own.
 */
typedef struct SinewBounds {
  /**
   * Its least corner.
   */
  float minimum[3];
  /**
   * Its greatest corner.
   */
  float maximum[3];
} SinewBounds;

/**
 * How a drag went. Set `struct_bytes` to `sizeof(SinewDragReport)` before the call.
 */
typedef struct SinewDragReport {
  /**
   * `sizeof(SinewDragReport)`.
   */
  size_t struct_bytes;
  /**
   * Largest distance of a held vertex from its target afterwards, units of the source; 0 where none is held.
   */
  float misfit;
  /**
   * Steps taken; 0 when none brought the vertices nearer, as when they are there.
   */
  uint32_t step_count;
} SinewDragReport;

/**
 * One instance: what `sinew_frame` would get. Members mean what they mean in `SinewFrameOptions`.
 */
typedef struct SinewInstance {
  /**
   * Its workspace, of either tier; no other instance's.
   */
  struct SinewWorkspace *workspace;
  /**
   * Its controls; no other instance's.
   */
  const struct SinewControls *controls;
  /**
   * Takes the deformed positions.
   */
  float *positions;
  /**
   * Floats that `positions` has room for: at least 3 V.
   */
  size_t position_floats;
  /**
   * Takes the normals; NULL where not wanted.
   */
  float *normals;
  /**
   * Floats that `normals` has room for: at least 3 V.
   */
  size_t normal_floats;
} SinewInstance;

/**
 * How an instance's last frame went. Set `struct_bytes` to `sizeof(SinewInstanceReport)` before the call.
 */
typedef struct SinewInstanceReport {
  /**
   * `sizeof(SinewInstanceReport)`.
   */
  size_t struct_bytes;
  /**
   * What `sinew_frame` would have returned; `SINEW_STATUS_OK` before the first frame.
   */
  SinewStatus status;
  /**
   * A `SinewFrameOutcome`; 0 before the first frame and where the frame was refused.
   */
  int32_t outcome;
} SinewInstanceReport;

/**
 * What a decoder cannot learn from the bytes. Zero everywhere suits most boxes.
 */
typedef struct SinewDecoderSettings {
  /**
   * `sizeof(SinewDecoderSettings)`.
   */
  size_t struct_bytes;
  /**
   * A `SinewProtocol`; 0: the first bytes decide.
   */
  int32_t protocol;
  /**
   * The largest value of lines, Firmata reports and OSC integers, at most 65535; 0: learned.
   */
  uint32_t full_scale;
  /**
   * A `SinewMidiCoding`, of all controllers.
   */
  int32_t midi_coding;
  /**
   * A `SinewMidiPairing`.
   */
  int32_t midi_pairing;
} SinewDecoderSettings;

/**
 * One reading of one knob. Set `struct_bytes` to `sizeof(SinewReading)` before the call.
 */
typedef struct SinewReading {
  /**
   * `sizeof(SinewReading)`.
   */
  size_t struct_bytes;
  /**
   * A `SinewReadingKind`.
   */
  int32_t kind;
  /**
   * Address of the knob on its device, at most 65535: column of a line, MIDI `channel * 128 + controller`, pin, or the
   * number of a name in order of appearance.
   */
  uint32_t knob;
  /**
   * Position from 0 to `full_scale`, or steps.
   */
  int32_t value;
  /**
   * The largest value that this device sends, 1023 for ten bits; 0 for steps.
   */
  uint32_t full_scale;
} SinewReading;

/**
 * What became of the bytes. Set `struct_bytes` to `sizeof(SinewCounters)` before the call. Totals since the decoder was
 * opened.
 */
typedef struct SinewCounters {
  /**
   * `sizeof(SinewCounters)`.
   */
  size_t struct_bytes;
  /**
   * Bytes fed.
   */
  uint64_t bytes;
  /**
   * Messages (lines, frames, MIDI and OSC messages) understood.
   */
  uint64_t good;
  /**
   * Messages that are sound and say nothing of knobs.
   */
  uint64_t ignored;
  /**
   * Messages refused; `last_fault` says why the last of them was.
   */
  uint64_t bad;
  /**
   * Messages cut by the opening of the port or by a replug; expected, so not bad.
   */
  uint64_t partial;
  /**
   * Messages known to be lost, and readings of datagrams that found no room.
   */
  uint64_t dropped;
  /**
   * Readings cut to the end of their scale.
   */
  uint64_t clamped;
  /**
   * Readings of knobs whose names found no room; they work by number.
   */
  uint64_t unnamed;
  /**
   * Readings made.
   */
  uint64_t readings;
  /**
   * Of those: readings that wait.
   */
  uint64_t waiting;
  /**
   * Times that the device was plugged in again.
   */
  uint64_t replugs;
  /**
   * Age of the last reading, microseconds; `UINT64_MAX` before the first.
   */
  uint64_t age_us;
  /**
   * Why the last message was not taken as it came: a number that stays the same in later versions; 0: all were.
   */
  uint32_t last_fault;
  /**
   * The same in words, ended by NUL; empty: all were.
   */
  char last_fault_text[SINEW_DECODER_TEXT_BYTES];
} SinewCounters;

/**
 * What a decoder knows of its device. Set `struct_bytes` to `sizeof(SinewDeviceInfo)` before the call.
 */
typedef struct SinewDeviceInfo {
  /**
   * `sizeof(SinewDeviceInfo)`.
   */
  size_t struct_bytes;
  /**
   * How it came to the protocol.
   */
  SinewRecognition recognition;
  /**
   * The protocol, named or found.
   */
  SinewProtocol protocol;
  /**
   * How sure that is, percent: 100 if it was named, 0 if it is not known, else by all messages so far.
   */
  uint32_t confidence;
  /**
   * Knobs of the device, where it said so; 0 otherwise.
   */
  uint32_t knob_count;
  /**
   * The same in words, ended by NUL.
   */
  char text[SINEW_DECODER_TEXT_BYTES];
  /**
   * What the firmware calls itself, ended by NUL; empty where it did not say.
   */
  char firmware[SINEW_FIRMWARE_BYTES];
} SinewDeviceInfo;

/**
 * One knob of the device. Zero everywhere but in the address is a knob that nobody calibrated.
 */
typedef struct SinewKnob {
  /**
   * Its address, as in `SinewReading`.
   */
  uint32_t address;
  /**
   * The largest value that the device can send; 0: not calibrated, and the next four members are not looked at.
   */
  uint32_t full_scale;
  /**
   * Reading at the lower stop, in steps of `full_scale` as those below.
   */
  uint32_t lowest;
  /**
   * Reading at the upper stop.
   */
  uint32_t highest;
  /**
   * Reading where it comes to rest by itself; 0: nowhere.
   */
  uint32_t centre;
  /**
   * Largest deviation of a resting knob from its mean.
   */
  uint32_t noise;
  /**
   * For encoders: travel of one step, parts of the whole, at most 1; 0: one hundredth.
   */
  float step;
} SinewKnob;

/**
 * One knob moves one control. Several bindings of one knob make a group.
 */
typedef struct SinewBinding {
  /**
   * Index of the knob on the surface.
   */
  uint32_t knob;
  /**
   * The control.
   */
  uint32_t control;
  /**
   * Page on which it holds, from 0; `SINEW_NONE`: on all.
   */
  uint32_t page;
  /**
   * A `SinewTakeover`.
   */
  int32_t takeover;
  /**
   * 0, or 1: clockwise lowers.
   */
  uint32_t inverted;
  /**
   * A `SinewCurve`.
   */
  int32_t curve;
  /**
   * Of the curve; not looked at where it is linear.
   */
  float curve_number;
  /**
   * A `SinewCentre`.
   */
  int32_t centre;
  /**
   * Share of the travel, at most 0.5; looked at for `SINEW_CENTRE_REST` alone.
   */
  float detent;
  /**
   * Weight at the lower end; with `maximum`, 0 and 0: the control's own stops. Never wider than those.
   */
  float minimum;
  /**
   * Weight at the upper end.
   */
  float maximum;
  /**
   * Fastest change, weight a second; 0: as fast as the hand.
   */
  float slew;
} SinewBinding;

/**
 * Which knobs there are, what they move, and what happens when the device does not behave. Start from zeros, set
 * `struct_bytes` and `knob_count`: the knobs then follow the tree of components.
 */
typedef struct SinewSurfaceSettings {
  /**
   * `sizeof(SinewSurfaceSettings)`.
   */
  size_t struct_bytes;
  /**
   * Knobs of the device, 1 to `SINEW_KNOBS_MAX`.
   */
  size_t knob_count;
  /**
   * The knobs, `knob_count` of them; NULL: not calibrated, and addresses from 0 on.
   */
  const struct SinewKnob *knobs;
  /**
   * `sizeof(SinewKnob)`; 0 where `knobs` is NULL.
   */
  size_t knob_bytes;
  /**
   * What the knobs move; NULL where `binding_count` is 0.
   */
  const struct SinewBinding *bindings;
  /**
   * At most `SINEW_BINDINGS_MAX`.
   */
  size_t binding_count;
  /**
   * `sizeof(SinewBinding)`; 0 where there are none.
   */
  size_t binding_bytes;
  /**
   * Index of the first knob that follows the tree; the others are for bindings.
   */
  uint32_t tree_first;
  /**
   * Knobs for coarse components. With `tree_fine`, 0 and 0: without bindings three eighths of the knobs are coarse and
   * the rest fine; with bindings no knob follows the tree.
   */
  uint32_t tree_coarse;
  /**
   * Knobs behind those for the children of the coarse knob last turned.
   */
  uint32_t tree_fine;
  /**
   * A `SinewTakeover`, of the knobs that follow the tree.
   */
  int32_t tree_takeover;
  /**
   * 0: a turn of a coarse knob brings its children; 1: only `SINEW_COMMAND_FOCUS` does.
   */
  uint32_t tree_stays;
  /**
   * Whether to correct readings for a supply that sags, 0 or 1: for potentiometers on a weak rail.
   */
  uint32_t follow_supply;
  /**
   * How long the pose of a device that is gone is held before it eases to rest, microseconds; 0: 5 seconds,
   * `UINT64_MAX`: for ever.
   */
  uint64_t hold_us;
  /**
   * How long the way to rest takes, microseconds; 0: 2 seconds.
   */
  uint64_t ease_us;
  /**
   * A device that sends all the time and is silent for this long counts as gone, microseconds; 0: never.
   */
  uint64_t silence_us;
} SinewSurfaceSettings;

/**
 * One knob as a display shows it. Set `struct_bytes` to `sizeof(SinewKnobState)` before the call.
 */
typedef struct SinewKnobState {
  /**
   * `sizeof(SinewKnobState)`.
   */
  size_t struct_bytes;
  /**
   * Where it stands with its control: of several the first that is not engaged.
   */
  SinewTakeoverState state;
  /**
   * That control; `SINEW_NONE` where there is none.
   */
  uint32_t control;
  /**
   * How far to turn, in travels of the knob; 0 unless it must be turned.
   */
  float distance;
  /**
   * Where the knob stands, calibrated and smoothed, 0 to 1; -1 for encoders, and before its first reading.
   */
  float position;
} SinewKnobState;

/**
 * How a surface and its device are doing. Set `struct_bytes` to `sizeof(SinewSurfaceStatus)` before the call.
 */
typedef struct SinewSurfaceStatus {
  /**
   * `sizeof(SinewSurfaceStatus)`.
   */
  size_t struct_bytes;
  /**
   * Readings taken.
   */
  uint64_t readings;
  /**
   * Of those: from addresses that no knob has.
   */
  uint64_t unlisted;
  /**
   * Times the device was lost.
   */
  uint64_t losses;
  /**
   * Whether the device is gone: said to be unplugged, or silent too long. 0 or 1, as those below.
   */
  uint32_t is_lost;
  /**
   * Of that: silent too long, though nobody said unplugged.
   */
  uint32_t is_silent;
  /**
   * It sends, but its noisy knobs do not tremble any more.
   */
  uint32_t is_frozen;
  /**
   * It sends more than it should.
   */
  uint32_t is_flooding;
  /**
   * A stop holds everything at rest, or is on its way there.
   */
  uint32_t is_stopped;
  /**
   * Page of the bindings, from 0.
   */
  uint32_t page;
  /**
   * Pages of the bindings.
   */
  uint32_t page_count;
  /**
   * Tree: the control whose children are on the coarse knobs; `SINEW_NONE`: the coarsest are.
   */
  uint32_t tree_parent;
  /**
   * Tree: the control whose children are on the fine knobs; `SINEW_NONE`: none are.
   */
  uint32_t tree_focus;
  /**
   * Supply over supply at the start; 1 unless it is followed.
   */
  float supply;
} SinewSurfaceStatus;

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
 * The interface version that the library was built with; `SINEW_ABI_VERSION` is that of the header. The functions that open
 * something compare the two.
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
 * The triangles of the render mesh, whose vertices `sinew_vertices_write` writes: those of `sinew_basis_faces` where the
 * package has no texture coordinates.
 *
 * `indices` takes a pointer into the package, good as long as the package stands; `index_count` takes 3 F.
 *
 * Errors: those of a handle; `OVERLAP`.
 * Threads: any number at a time.
 *
 * # Safety
 * `basis` is NULL or a basis; the others are NULL or writable.
 */
SinewStatus sinew_basis_render_faces(const struct SinewBasis *basis,
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
 * How much memory a workspace of the exact tier needs for this basis.
 *
 * Errors: those of a handle; `OVERLAP`.
 * Threads: any number at a time.
 *
 * # Safety
 * `basis` is NULL or a basis; `layout` is NULL or writable.
 */
SinewStatus sinew_workspace_layout(const struct SinewBasis *basis, struct SinewLayout *layout);

/**
 * The same for a workspace with options.
 *
 * `options`: NULL for the exact tier.
 *
 * Errors: those of a handle; `NO_FAST_TIER`, `STRUCT_SIZE`, `UNKNOWN_OPTION`, `OVERLAP`.
 * Threads: any number at a time.
 *
 * # Safety
 * `basis` is NULL or a basis; `options` is NULL or as long as its first member says; `layout` is NULL or writable.
 */
SinewStatus sinew_workspace_layout_for(const struct SinewBasis *basis,
                                       const struct SinewWorkspaceOptions *options,
                                       struct SinewLayout *layout);

/**
 * Makes a workspace of the exact tier, at rest.
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
 * The same with options.
 *
 * `options`: NULL for the exact tier.
 * `memory`, `memory_bytes`: at least what `sinew_workspace_layout_for` says for these options.
 *
 * Errors: those of `sinew_workspace_create`; `NO_FAST_TIER`, `UNKNOWN_OPTION`.
 * Threads: any number at a time, each with `memory` of its own.
 *
 * # Safety
 * As for `sinew_workspace_create`; `options` is NULL or as long as its first member says.
 */
SinewStatus sinew_workspace_create_for(const struct SinewBasis *basis,
                                       const struct SinewWorkspaceOptions *options,
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
 * Plays one frame: the rest shape deformed by the controls, on the tier that the workspace was made for.
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

/**
 * Writes the vertices of a frame into a vertex buffer. Render vertices are those of `sinew_basis_render_faces`,
 * `render_vertex_count` of them. For buffers in separate memory call it once for each.
 *
 * `bounds`: NULL, or takes the box around all positions.
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Allocates nothing. Positions, normals, the vertex buffer and the scratch must not overlap.
 *
 * Errors: those of a handle; `TOO_SHORT`, `TOO_LONG`, `NO_NORMALS`, `NO_TEXTURE`, `STRIDE_TOO_SHORT`,
 * `ATTRIBUTES_OVERLAP`, `OVERLAP`, `STRUCT_SIZE`, `UNKNOWN_OPTION`.
 * Threads: any number at a time, each with memory of its own.
 *
 * # Safety
 * `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths.
 */
SinewStatus sinew_vertices_write(const struct SinewBasis *basis,
                                 const struct SinewVertexOptions *options,
                                 struct SinewBounds *bounds,
                                 struct SinewDetails *details);

/**
 * How much memory handles for this basis need: 12 bytes a vertex for each, 36 a vertex for all, and about 800 a control.
 *
 * `capacity`: vertices held at once; more than `SINEW_HANDLES_MAX` count as that many.
 *
 * Errors: those of a handle; `OVERLAP`.
 * Threads: any number at a time.
 *
 * # Safety
 * `basis` is NULL or a basis; `layout` is NULL or writable.
 */
SinewStatus sinew_handles_layout(const struct SinewBasis *basis,
                                 uint32_t capacity,
                                 struct SinewLayout *layout);

/**
 * Makes handles; no vertex is held, no control pinned.
 *
 * `memory`, `memory_bytes`: at least what `sinew_handles_layout` says for this `capacity`; what lies beyond that stays
 * untouched.
 * `handles`: takes the handle, which lies at `memory`.
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Errors: those of a handle; `TOO_SHORT`, `TOO_LONG`, `OVERLAP`, `STRUCT_SIZE`.
 * Threads: any number at a time, each with `memory` of its own.
 *
 * # Safety
 * `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths. `memory` stays in place, and is
 * written by nobody else, until the last use of the handles.
 */
SinewStatus sinew_handles_create(const struct SinewBasis *basis,
                                 uint32_t capacity,
                                 uint8_t *memory,
                                 size_t memory_bytes,
                                 struct SinewHandles **handles,
                                 struct SinewDetails *details);

/**
 * Ends handles: later calls with them are refused with `CLOSED_HANDLE` while their memory stands. There is nothing to free,
 * so this is optional before the memory is given back.
 *
 * Errors: those of a handle.
 * Threads: one at a time for each handles handle; another one's use at this moment is noticed.
 *
 * # Safety
 * `handles` is NULL or points to a handle's memory.
 */
SinewStatus sinew_handles_close(struct SinewHandles *handles);

/**
 * Takes hold of a vertex where the workspace's last frame has it: costs one solve, and every drag from now on a little. Its
 * target is its place, so a vertex that is never moved is held there.
 *
 * `workspace`: of the exact tier; keeps its pose.
 * `vertex`: source order.
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Errors: those of a handle; `FOREIGN_HANDLES`, `FOREIGN_WORKSPACE`, `NEEDS_EXACT_TIER`, `NO_SUCH_VERTEX`,
 * `ALREADY_HELD`, `HANDLES_FULL`, `OVERLAP`, `STRUCT_SIZE`.
 * Threads: one at a time for each workspace and each handles handle; another one's use at this moment is noticed.
 *
 * # Safety
 * The handles are NULL or handles of their kind; `details` is NULL or as long as its first member says.
 */
SinewStatus sinew_handles_add(const struct SinewBasis *basis,
                              struct SinewHandles *handles,
                              struct SinewWorkspace *workspace,
                              uint32_t vertex,
                              struct SinewDetails *details);

/**
 * Lets go of a vertex.
 *
 * Errors: those of a handle; `NOT_HELD`.
 * Threads: one at a time for each handles handle; another one's use at this moment is noticed.
 *
 * # Safety
 * `handles` is NULL or handles.
 */
SinewStatus sinew_handles_remove(struct SinewHandles *handles, uint32_t vertex);

/**
 * Lets go of all vertices. Pinned controls stay pinned.
 *
 * Errors: those of a handle.
 * Threads: one at a time for each handles handle; another one's use at this moment is noticed.
 *
 * # Safety
 * `handles` is NULL or handles.
 */
SinewStatus sinew_handles_clear(struct SinewHandles *handles);

/**
 * Says where a held vertex should go; the next `sinew_drag` moves it there.
 *
 * `target`: three floats, units of the source.
 *
 * Errors: those of a handle; `NOT_HELD`, `NOT_FINITE` (the last target stays), `OVERLAP`.
 * Threads: one at a time for each handles handle; another one's use at this moment is noticed.
 *
 * # Safety
 * `handles` is NULL or handles; `target` is NULL or readable for three floats.
 */
SinewStatus sinew_handles_target(struct SinewHandles *handles,
                                 uint32_t vertex,
                                 const float *target);

/**
 * Leaves a control alone while dragging, or no longer.
 *
 * `is_pinned`: 0: dragging moves it; anything else: it does not.
 *
 * Errors: those of a handle; `NO_SUCH_CONTROL`.
 * Threads: one at a time for each handles handle; another one's use at this moment is noticed.
 *
 * # Safety
 * `handles` is NULL or handles.
 */
SinewStatus sinew_handles_pin(struct SinewHandles *handles, uint32_t control, int32_t is_pinned);

/**
 * Moves the weights so that the held vertices come nearer to their targets: once for each update of the mouse, and play a
 * frame afterwards. Coarse controls go as far as they are of use, then finer ones, each within its stops; of all ways, the
 * one with the least steps. Pinned controls do not move.
 *
 * `workspace`: of the exact tier; lends its kernels and keeps its pose.
 * `controls`: the current pose; take that of the drag.
 * `report`: NULL, or takes how it went.
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Allocates nothing; a fixed number of steps.
 *
 * Errors: those of a handle; `FOREIGN_HANDLES`, `FOREIGN_WORKSPACE`, `FOREIGN_CONTROLS`, `NEEDS_EXACT_TIER`,
 * `NOT_FINITE` (something wrote over the weights), `HELD_OVERFLOW`, `OVERLAP`, `STRUCT_SIZE`.
 * Threads: one at a time for each workspace, each controls and each handles handle; another one's use at this moment is
 * noticed.
 *
 * # Safety
 * The handles are NULL or handles of their kind; the others are NULL or as long as their first member says.
 */
SinewStatus sinew_drag(const struct SinewBasis *basis,
                       struct SinewHandles *handles,
                       struct SinewWorkspace *workspace,
                       struct SinewControls *controls,
                       struct SinewDragReport *report,
                       struct SinewDetails *details);

/**
 * How much memory a batch needs.
 *
 * Errors: `NULL_POINTER`, `MISALIGNED`.
 * Threads: any.
 *
 * # Safety
 * `layout` is NULL or writable.
 */
SinewStatus sinew_batch_layout(size_t instance_count, struct SinewLayout *layout);

/**
 * Makes a batch of instances, with its first round begun. Checks each against each, so it takes time with the square of
 * their number.
 *
 * `instances`, `instance_count`, `instance_bytes`: copied; the last is `sizeof(SinewInstance)`. Handles are of `basis`;
 * those that are of other content are refused when they are played.
 * `memory`, `memory_bytes`: at least what `sinew_batch_layout` says; what lies beyond that stays untouched.
 * `batch`: takes the handle, which lies at `memory`.
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Errors: those of a handle; `TOO_SHORT`, `TOO_LONG`, `OVERLAP` (of instances with each other too), `STRUCT_SIZE`,
 * `UNKNOWN_OPTION`.
 * Threads: any number at a time, each with memory of its own.
 *
 * # Safety
 * `basis` is NULL or a basis; the others are NULL or point to memory of the stated lengths. `memory`, and what the instances
 * point to, stay in place until the last use of the batch.
 */
SinewStatus sinew_batch_create(const struct SinewBasis *basis,
                               const struct SinewInstance *instances,
                               size_t instance_count,
                               size_t instance_bytes,
                               uint8_t *memory,
                               size_t memory_bytes,
                               struct SinewBatch **batch,
                               struct SinewDetails *details);

/**
 * Ends a batch: later calls with it are refused with `CLOSED_HANDLE` while its memory stands. There is nothing to free, so
 * this is optional before the memory is given back.
 *
 * Errors: those of a handle.
 * Threads: alone; another one's use at this moment is noticed.
 *
 * # Safety
 * `batch` is NULL or points to a handle's memory.
 */
SinewStatus sinew_batch_close(struct SinewBatch *batch);

/**
 * Plays a frame of instances until none is left of this round. Any number of threads call it for one round; each instance
 * is played once, by the thread that comes first, and the results have the same bits whatever the number of threads. The
 * round is over when every call has returned; what became of each instance, `sinew_batch_report` says.
 *
 * `basis`: of the instances' content.
 * `played`: NULL, or takes how many instances this call had.
 * `details`: NULL, or takes the numbers behind a refusal of the call itself.
 *
 * Allocates nothing and waits for nothing.
 *
 * Errors: those of a handle; `OVERLAP`, `STRUCT_SIZE`. A refusal of one instance stays with it.
 * Threads: any number at a time for one batch.
 *
 * # Safety
 * `basis` is NULL or a basis; `batch` is NULL or a batch; the others are NULL or writable.
 */
SinewStatus sinew_batch_play(const struct SinewBasis *basis,
                             const struct SinewBatch *batch,
                             size_t *played,
                             struct SinewDetails *details);

/**
 * Begins the next round: every instance will be played again.
 *
 * Errors: those of a handle; `IN_USE` while another thread is playing.
 * Threads: alone; another one's use at this moment is noticed.
 *
 * # Safety
 * `batch` is NULL or a batch.
 */
SinewStatus sinew_batch_begin(struct SinewBatch *batch);

/**
 * How an instance's last frame went.
 *
 * Errors: those of a handle; `NO_SUCH_INSTANCE`, `STRUCT_SIZE`, `OVERLAP`.
 * Threads: any number at a time for one batch; certain once the round is over.
 *
 * # Safety
 * `batch` is NULL or a batch; `report` is NULL or as long as its first member says.
 */
SinewStatus sinew_batch_report(const struct SinewBatch *batch,
                               size_t instance,
                               struct SinewInstanceReport *report);

/**
 * How much memory a decoder needs; the same for every device.
 *
 * Errors: `NULL_POINTER`, `MISALIGNED`.
 * Threads: any.
 *
 * # Safety
 * `layout` is NULL or writable.
 */
SinewStatus sinew_decoder_layout(struct SinewLayout *layout);

/**
 * Opens a decoder at the beginning of a device's bytes. Needs no basis.
 *
 * `abi_version`: pass `SINEW_ABI_VERSION`.
 * `settings`: NULL for the usual ones: the first bytes decide what the device speaks.
 * `memory`, `memory_bytes`: at least what `sinew_decoder_layout` says; what lies beyond that stays untouched.
 * `decoder`: takes the handle, which lies at `memory`.
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Errors: `WRONG_ABI`, `TOO_SHORT`, `TOO_LONG`, `OVERLAP`, `STRUCT_SIZE`, `UNKNOWN_OPTION`.
 * Threads: any; one call for one `memory`.
 *
 * # Safety
 * The pointers are NULL or point to memory of the stated lengths. `memory` stays in place, and is written by nobody else,
 * until the last use of the decoder.
 */
SinewStatus sinew_decoder_open(uint32_t abi_version,
                               const struct SinewDecoderSettings *settings,
                               uint8_t *memory,
                               size_t memory_bytes,
                               struct SinewDecoder **decoder,
                               struct SinewDetails *details);

/**
 * Ends a decoder: later calls with it are refused with `CLOSED_HANDLE` while its memory stands. There is nothing to free,
 * so this is optional before the memory is given back.
 *
 * Errors: those of a handle.
 * Threads: one at a time for each decoder; another one's use at this moment is noticed.
 *
 * # Safety
 * `decoder` is NULL or points to a handle's memory.
 */
SinewStatus sinew_decoder_close(struct SinewDecoder *decoder);

/**
 * What to send to the device once after its port was opened, so that it begins: nothing for most.
 *
 * `bytes`, `capacity`: 37 bytes are always enough.
 * `length`: takes the number of bytes written.
 *
 * Errors: those of a handle; `TOO_SHORT` (nothing was written), `OVERLAP`.
 * Threads: one at a time for each decoder; another one's use at this moment is noticed.
 *
 * # Safety
 * `decoder` is NULL or a decoder; the others are NULL or writable, `bytes` for `capacity`.
 */
SinewStatus sinew_decoder_greeting(struct SinewDecoder *decoder,
                                   uint8_t *bytes,
                                   size_t capacity,
                                   size_t *length);

/**
 * Feeds bytes of the device's stream, cut anywhere.
 *
 * `now_us`: microseconds of a clock of yours that never runs back.
 * `bytes`, `length`: what the port gave; may be none.
 * `taken`: takes how many bytes were used. Fewer than `length` when half of `SINEW_DECODER_READINGS` wait: ask for them,
 * then feed the rest. So no reading of a stream is ever lost here.
 *
 * Allocates nothing and waits for nothing. Bytes that make no sense are counted, never an error.
 *
 * Errors: those of a handle; `TOO_LONG`, `OVERLAP`.
 * Threads: one at a time for each decoder; another one's use at this moment is noticed. A thread that reads the port and one
 * that asks must take turns.
 *
 * # Safety
 * `decoder` is NULL or a decoder; `bytes` is NULL or readable for `length`; `taken` is NULL or writable.
 */
SinewStatus sinew_decoder_feed(struct SinewDecoder *decoder,
                               uint64_t now_us,
                               const uint8_t *bytes,
                               size_t length,
                               size_t *taken);

/**
 * Feeds one datagram, whole: OSC as it comes over UDP. What finds no room among the readings that wait is dropped and
 * counted.
 *
 * `now_us`: microseconds of a clock of yours that never runs back.
 *
 * Errors: those of a handle; `TOO_LONG`, `OVERLAP`.
 * Threads: one at a time for each decoder; another one's use at this moment is noticed.
 *
 * # Safety
 * `decoder` is NULL or a decoder; `bytes` is NULL or readable for `length`.
 */
SinewStatus sinew_decoder_feed_packet(struct SinewDecoder *decoder,
                                      uint64_t now_us,
                                      const uint8_t *bytes,
                                      size_t length);

/**
 * The device was plugged in again: what is half read is thrown away. Protocol, names, scales and counters stay, so that a
 * knob has the same number as before.
 *
 * Errors: those of a handle.
 * Threads: one at a time for each decoder; another one's use at this moment is noticed.
 *
 * # Safety
 * `decoder` is NULL or a decoder.
 */
SinewStatus sinew_decoder_replugged(struct SinewDecoder *decoder);

/**
 * The oldest reading that waits, which then waits no more; `kind` is `SINEW_READING_KIND_NONE` when none does.
 *
 * Errors: those of a handle; `STRUCT_SIZE`, `OVERLAP`.
 * Threads: one at a time for each decoder; another one's use at this moment is noticed.
 *
 * # Safety
 * `decoder` is NULL or a decoder; `reading` is NULL or as long as its first member says.
 */
SinewStatus sinew_decoder_next(struct SinewDecoder *decoder,
                               struct SinewReading *reading);

/**
 * What became of the bytes so far.
 *
 * `now_us`: on the clock of `sinew_decoder_feed`, for the age of the last reading.
 *
 * Errors: those of a handle; `STRUCT_SIZE`, `OVERLAP`.
 * Threads: one at a time for each decoder; another one's use at this moment is noticed.
 *
 * # Safety
 * `decoder` is NULL or a decoder; `counters` is NULL or as long as its first member says.
 */
SinewStatus sinew_decoder_counters(const struct SinewDecoder *decoder,
                                   uint64_t now_us,
                                   struct SinewCounters *counters);

/**
 * What the decoder knows of its device: what it speaks and how sure that is.
 *
 * Errors: those of a handle; `STRUCT_SIZE`, `OVERLAP`.
 * Threads: one at a time for each decoder; another one's use at this moment is noticed.
 *
 * # Safety
 * `decoder` is NULL or a decoder; `info` is NULL or as long as its first member says.
 */
SinewStatus sinew_decoder_info(const struct SinewDecoder *decoder, struct SinewDeviceInfo *info);

/**
 * What the device calls a knob: its label, OSC address, or from a HELLO; UTF-8, ended by NUL, empty where it has no name.
 * `SINEW_KNOB_NAME_BYTES` are always enough.
 *
 * Errors: those of a handle; `TOO_SHORT` (nothing was written), `OVERLAP`.
 * Threads: one at a time for each decoder; another one's use at this moment is noticed.
 *
 * # Safety
 * `decoder` is NULL or a decoder; `name` is NULL or writable for `name_bytes`.
 */
SinewStatus sinew_decoder_knob_name(const struct SinewDecoder *decoder,
                                    uint32_t knob,
                                    char *name,
                                    size_t name_bytes);

/**
 * How much memory a surface with these settings needs. Checks the settings as `sinew_surface_create` does.
 *
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Errors: those of a handle and of `sinew_surface_create`; `OVERLAP`.
 * Threads: any number at a time.
 *
 * # Safety
 * `basis` is NULL or a basis; `settings` is NULL or as long as its first member says, and its arrays as long as it says;
 * the others are NULL or writable.
 */
SinewStatus sinew_surface_layout(const struct SinewBasis *basis,
                                 const struct SinewSurfaceSettings *settings,
                                 struct SinewLayout *layout,
                                 struct SinewDetails *details);

/**
 * Makes a surface that has heard nothing yet and holds every weight. The settings are copied.
 *
 * `memory`, `memory_bytes`: at least what `sinew_surface_layout` says for these settings; what lies beyond that stays
 * untouched.
 * `surface`: takes the handle, which lies at `memory`.
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Errors: those of a handle; `TOO_SHORT`, `TOO_LONG`, `OVERLAP`, `STRUCT_SIZE`, `UNKNOWN_OPTION`, `TOO_MANY`,
 * `KNOB_TWICE`, `BAD_READING` (an address above 65535), `BAD_CALIBRATION`, `BAD_STEP`, `NO_SUCH_KNOB`,
 * `NO_SUCH_CONTROL`, `NO_SUCH_PAGE`, `TWO_HANDS`, `BAD_TREE`, `BAD_RESPONSE`.
 * Threads: any number at a time, each with `memory` of its own.
 *
 * # Safety
 * As for `sinew_surface_layout`; `memory` stays in place, and is written by nobody else, until the last use of the
 * surface, and so does the package.
 */
SinewStatus sinew_surface_create(const struct SinewBasis *basis,
                                 const struct SinewSurfaceSettings *settings,
                                 uint8_t *memory,
                                 size_t memory_bytes,
                                 struct SinewSurface **surface,
                                 struct SinewDetails *details);

/**
 * Ends a surface: later calls with it are refused with `CLOSED_HANDLE` while its memory stands. There is nothing to free,
 * so this is optional before the memory is given back.
 *
 * Errors: those of a handle.
 * Threads: one at a time for each surface; another one's use at this moment is noticed.
 *
 * # Safety
 * `surface` is NULL or points to a handle's memory.
 */
SinewStatus sinew_surface_close(struct SinewSurface *surface);

/**
 * Takes a reading, as it arrives: from `sinew_decoder_next`, or a slider of yours. No control moves before the next
 * `sinew_surface_advance`. A device thought lost that speaks is back.
 *
 * `now_us`: microseconds of a clock of yours that never runs back.
 *
 * Errors: those of a handle; `STRUCT_SIZE`, `UNKNOWN_OPTION`, `BAD_READING`, `OVERLAP`. An address that no knob has is
 * counted, not refused.
 * Threads: one at a time for each surface; another one's use at this moment is noticed.
 *
 * # Safety
 * `surface` is NULL or a surface; `reading` is NULL or as long as its first member says.
 */
SinewStatus sinew_surface_take(struct SinewSurface *surface,
                               uint64_t now_us,
                               const struct SinewReading *reading);

/**
 * The device is gone: the pose holds, then eases to rest.
 *
 * Errors: those of a handle.
 * Threads: one at a time for each surface; another one's use at this moment is noticed.
 *
 * # Safety
 * `surface` is NULL or a surface.
 */
SinewStatus sinew_surface_unplugged(struct SinewSurface *surface, uint64_t now_us);

/**
 * The device is back: nothing moves until each knob has picked up its controls, whatever its takeover. See
 * `sinew_decoder_replugged` too.
 *
 * Errors: those of a handle.
 * Threads: one at a time for each surface; another one's use at this moment is noticed.
 *
 * # Safety
 * `surface` is NULL or a surface.
 */
SinewStatus sinew_surface_replugged(struct SinewSurface *surface,
                                    uint64_t now_us);

/**
 * Does what a button would: stop, pages.
 *
 * `command`: a `SinewCommand`.
 * `argument`: of `SINEW_COMMAND_FOCUS` and `SINEW_COMMAND_PAGE`; not looked at for the others.
 *
 * Errors: those of a handle; `UNKNOWN_OPTION`, `NO_SUCH_CONTROL`, `NO_SUCH_PAGE`.
 * Threads: one at a time for each surface; another one's use at this moment is noticed.
 *
 * # Safety
 * `surface` is NULL or a surface.
 */
SinewStatus sinew_surface_command(struct SinewSurface *surface, int32_t command, uint32_t argument);

/**
 * Moves the controls on to `now_us`, once a frame. But where a knob jumps, a control goes no further than its knob did, and
 * never faster than its slew limit. Time that stands still or runs back moves nothing.
 *
 * `controls`: of the content that the surface was made for.
 * `details`: NULL, or takes the numbers behind a refusal.
 *
 * Allocates nothing and waits for nothing.
 *
 * Errors: those of a handle; `FOREIGN_CONTROLS`, `NOT_FINITE` (something wrote over the weights), `OVERLAP`, `STRUCT_SIZE`.
 * Threads: one at a time for each surface and each controls handle; another one's use at this moment is noticed.
 *
 * # Safety
 * The handles are NULL or handles of their kind; `details` is NULL or as long as its first member says.
 */
SinewStatus sinew_surface_advance(struct SinewSurface *surface,
                                  struct SinewControls *controls,
                                  uint64_t now_us,
                                  struct SinewDetails *details);

/**
 * One knob, for a display that says "turn left to pick up".
 *
 * `knob`: index of the knob on the surface.
 *
 * Errors: those of a handle; `NO_SUCH_KNOB`, `STRUCT_SIZE`, `OVERLAP`.
 * Threads: one at a time for each surface; another one's use at this moment is noticed.
 *
 * # Safety
 * `surface` is NULL or a surface; `state` is NULL or as long as its first member says.
 */
SinewStatus sinew_surface_knob(const struct SinewSurface *surface,
                               uint32_t knob,
                               struct SinewKnobState *state);

/**
 * How the surface and its device are doing.
 *
 * Errors: those of a handle; `STRUCT_SIZE`, `OVERLAP`.
 * Threads: one at a time for each surface; another one's use at this moment is noticed.
 *
 * # Safety
 * `surface` is NULL or a surface; `status` is NULL or as long as its first member says.
 */
SinewStatus sinew_surface_status(const struct SinewSurface *surface,
                                 struct SinewSurfaceStatus *status);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SINEW_H */
