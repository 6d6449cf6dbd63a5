/* Sinew for C, knobs: the bytes of a knob box move controls. The port is yours, and so is its clock: microseconds that never
 * run back. Bytes come out of the port, readings out of those, weights out of those.
 * Written by cbindgen from runtime/capi/src: change that, not this file. sinew.h says what holds for all calls.
 *
 *   sinew_decoder_open       once for each device; it finds out what the device speaks
 *   sinew_surface_create     once for each device: which knob moves what; by default the knobs follow the tree
 *   sinew_decoder_feed       whenever the port has bytes
 *   sinew_decoder_greeting   after it: what to write to the port, nearly always nothing
 *   sinew_decoder_next       until nothing waits: a reading, for
 *   sinew_surface_read       which remembers it
 *   sinew_surface_advance    each frame, before sinew_frame: moves the controls
 */

#ifndef SINEW_KNOBS_H
#define SINEW_KNOBS_H

#include "sinew.h"

/// Bytes of a buffer that holds any knob's name, with the NUL.
#define SINEW_KNOB_NAME_BYTES 33

/// Bytes of a sentence about a decoder, with the NUL.
#define SINEW_DECODER_TEXT_BYTES 120

/// Bytes of what a firmware calls itself, with the NUL.
#define SINEW_FIRMWARE_BYTES 40

/// Readings that wait in a decoder, at most.
#define SINEW_DECODER_READINGS 2048

/// Bytes of a buffer that holds any greeting.
#define SINEW_GREETING_BYTES 37

/// Knobs of a surface, at most.
#define SINEW_KNOBS_MAX 128

/// Bindings of a surface, at most.
#define SINEW_BINDINGS_MAX 512

/// What a device speaks.
typedef int32_t SinewProtocol;
enum {
  /// Not known. As a setting: the first bytes decide.
  SINEW_PROTOCOL_UNKNOWN = 0,
  /// Text lines of numbers: deej, CSV, Serial Plotter.
  SINEW_PROTOCOL_LINES = 1,
  /// Sinew's own framed packets, `docs/knob-protocol.md`.
  SINEW_PROTOCOL_PACKETS = 2,
  /// MIDI bytes.
  SINEW_PROTOCOL_MIDI = 3,
  /// Firmata analog reports.
  SINEW_PROTOCOL_FIRMATA = 4,
  /// OSC, in datagrams or in SLIP.
  SINEW_PROTOCOL_OSC = 5,
};

/// How MIDI controllers count.
typedef int32_t SinewMidiCoding;
enum {
  /// Positions, 0 to 127.
  SINEW_MIDI_CODING_ABSOLUTE = 0,
  /// Steps in two's complement of seven bits: 1 is one clockwise, 127 one back.
  SINEW_MIDI_CODING_TWOS_COMPLEMENT = 1,
  /// Steps with a sign bit: 1 is one clockwise, 65 one back.
  SINEW_MIDI_CODING_SIGNED_BIT = 2,
  /// Steps around 64: 65 is one clockwise, 63 one back.
  SINEW_MIDI_CODING_BINARY_OFFSET = 3,
};

/// Whether the MIDI controllers 0 to 31 have their lower seven bits in 32 to 63.
typedef int32_t SinewMidiPairing;
enum {
  /// Learned a controller at a time.
  SINEW_MIDI_PAIRING_LEARNED = 0,
  /// All are pairs.
  SINEW_MIDI_PAIRING_ALWAYS = 1,
  /// None is.
  SINEW_MIDI_PAIRING_NEVER = 2,
};

/// What a reading says.
typedef int32_t SinewReadingKind;
enum {
  /// Nothing waits.
  SINEW_READING_KIND_NONE = 0,
  /// The knob stands at `value` of `full_scale`.
  SINEW_READING_KIND_POSITION = 1,
  /// The knob was turned by `value` steps; clockwise is positive.
  SINEW_READING_KIND_STEPS = 2,
};

/// How a decoder came to its protocol.
typedef int32_t SinewRecognition;
enum {
  /// The settings named it.
  SINEW_RECOGNITION_NAMED = 1,
  /// So few bytes came that nothing is said yet.
  SINEW_RECOGNITION_LISTENING = 2,
  /// Many bytes came and no protocol fits: a wrong baud rate, or a device of another kind. It goes on listening.
  SINEW_RECOGNITION_UNDECIDED = 3,
  /// The bytes told.
  SINEW_RECOGNITION_FOUND = 4,
};

/// What a knob does with a control that stands elsewhere.
typedef int32_t SinewTakeover;
enum {
  /// The control waits until the knob passes its place, however fast.
  SINEW_TAKEOVER_PICKUP = 0,
  /// The control goes to the knob at the knob's first move.
  SINEW_TAKEOVER_JUMP = 1,
  /// The control follows in proportion, so that both meet at an end.
  SINEW_TAKEOVER_SCALE = 2,
  /// The control moves as much as the knob.
  SINEW_TAKEOVER_RELATIVE = 3,
};

/// Shape of the way from one end to the other. `curve_number` is the slope at the steep end over that at the flat one, above
/// 1, at most 1000; of an S curve the slope in the middle, 1 to 8.
typedef int32_t SinewCurve;
enum {
  /// Equal turns, equal moves.
  SINEW_CURVE_LINEAR = 0,
  /// Fine at the start, coarse at the end.
  SINEW_CURVE_EXPONENTIAL = 1,
  /// Coarse at the start, fine at the end.
  SINEW_CURVE_LOGARITHMIC = 2,
  /// Fine at both ends.
  SINEW_CURVE_S = 3,
};

/// Where rest stands on a knob.
typedef int32_t SinewCentre;
enum {
  /// In the middle, with a detent of 3 % of the travel; where the control moves one way only, as `EVEN`.
  SINEW_CENTRE_USUAL = 0,
  /// The range is spread evenly; rest stands where it falls.
  SINEW_CENTRE_EVEN = 1,
  /// In the middle, with a detent of `detent`.
  SINEW_CENTRE_REST = 2,
};

/// What to do, as a button of the device would.
typedef int32_t SinewCommand;
enum {
  /// Ease everything to rest and hold it there until `RELEASE`.
  SINEW_COMMAND_STOP = 1,
  /// End a stop: each control stays at rest until its knob picks it up.
  SINEW_COMMAND_RELEASE = 2,
  /// Next page: of the tree if there is one, of the bindings otherwise. The last is followed by the first.
  SINEW_COMMAND_NEXT = 3,
  /// Previous page.
  SINEW_COMMAND_PREVIOUS = 4,
  /// Tree: the children of the knob last turned take the coarse knobs.
  SINEW_COMMAND_INTO = 5,
  /// Tree: back up.
  SINEW_COMMAND_OUT = 6,
  /// Tree: next page of the fine knobs.
  SINEW_COMMAND_NEXT_FINE = 7,
  /// Tree: the children of the control in `argument` come onto the fine knobs.
  SINEW_COMMAND_FOCUS = 8,
  /// The page of the bindings in `argument`, from 0.
  SINEW_COMMAND_PAGE = 9,
};

/// Where a knob stands with what it should move.
typedef int32_t SinewTakeoverState;
enum {
  /// The knob moves nothing on this page.
  SINEW_TAKEOVER_STATE_UNASSIGNED = 0,
  /// The knob has not been heard of since it was plugged in.
  SINEW_TAKEOVER_STATE_UNHEARD = 1,
  /// Everything is held: unplugged, easing to rest, or stopped.
  SINEW_TAKEOVER_STATE_HELD = 2,
  /// The knob moves its control.
  SINEW_TAKEOVER_STATE_ENGAGED = 3,
  /// The knob must first be turned left, counter-clockwise, to pick its control up.
  SINEW_TAKEOVER_STATE_TURN_LEFT = 4,
  /// The knob must first be turned right.
  SINEW_TAKEOVER_STATE_TURN_RIGHT = 5,
};

/// Reads one device, whatever it speaks.
typedef struct SinewDecoder SinewDecoder;

/// One device's knobs on the controls of one basis. Refers to the package's bytes, as the basis does.
typedef struct SinewSurface SinewSurface;

/// What a decoder cannot learn from the bytes. Zero everywhere suits most boxes.
typedef struct SinewDecoderSettings {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// What the device speaks.
  SinewProtocol protocol;
  /// The largest value of lines, Firmata reports and OSC integers, at most 65535; 0: learned.
  uint32_t full_scale;
  /// Of all controllers.
  SinewMidiCoding midi_coding;
  /// Of all channels.
  SinewMidiPairing midi_pairing;
} SinewDecoderSettings;

/// One reading of one knob.
typedef struct SinewReading {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// When its bytes came, on your clock, microseconds.
  uint64_t time_us;
  /// What `value` says.
  SinewReadingKind kind;
  /// Address of the knob on its device, at most 65535: column of a line, MIDI `channel * 128 + controller`, pin, or the
  /// number of a name in order of appearance.
  uint32_t knob;
  /// Position from 0 to `full_scale`, or steps.
  int32_t value;
  /// The largest value that this device sends, 1023 for ten bits; 0 for steps.
  uint32_t full_scale;
} SinewReading;

/// What became of the bytes. Totals since the decoder was opened.
typedef struct SinewCounters {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// Bytes fed.
  uint64_t bytes;
  /// Messages (lines, frames, MIDI and OSC messages) understood.
  uint64_t good;
  /// Messages that are sound and say nothing of knobs.
  uint64_t ignored;
  /// Messages refused; `last_fault` says why the last of them was.
  uint64_t bad;
  /// Messages cut by the opening of the port or by a replug; expected, so not bad.
  uint64_t partial;
  /// Messages known to be lost, and readings of datagrams that found no room.
  uint64_t dropped;
  /// Readings cut to the end of their scale.
  uint64_t clamped;
  /// Readings of knobs whose names found no room; they work by number.
  uint64_t unnamed;
  /// Readings made.
  uint64_t readings;
  /// Of those: readings that wait.
  uint64_t waiting;
  /// Times that the device was plugged in again.
  uint64_t replugs;
  /// Age of the last reading, microseconds; `UINT64_MAX` before the first.
  uint64_t age_us;
  /// Why the last message was not taken as it came: a number that stays the same in later versions; 0: all were.
  uint32_t last_fault;
  /// The same in words, ended by NUL; empty: all were.
  char last_fault_text[SINEW_DECODER_TEXT_BYTES];
} SinewCounters;

/// What a decoder knows of its device.
typedef struct SinewDeviceInfo {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// How it came to the protocol.
  SinewRecognition recognition;
  /// The protocol, named or found.
  SinewProtocol protocol;
  /// How sure that is, percent: 100 if it was named, 0 if it is not known, else by all messages so far.
  uint32_t confidence;
  /// Knobs of the device, where it said so; 0 otherwise.
  uint32_t knob_count;
  /// The same in words, ended by NUL.
  char text[SINEW_DECODER_TEXT_BYTES];
  /// What the firmware calls itself, ended by NUL; empty where it did not say.
  char firmware[SINEW_FIRMWARE_BYTES];
} SinewDeviceInfo;

/// One knob of the device. Zero everywhere but in the address is a knob that nobody calibrated.
typedef struct SinewKnob {
  /// Its address, as in `SinewReading`.
  uint32_t address;
  /// The largest value that the device can send; 0: not calibrated, and the next four members are not looked at.
  uint32_t full_scale;
  /// Reading at the lower stop, in steps of `full_scale` as those below.
  uint32_t lowest;
  /// Reading at the upper stop.
  uint32_t highest;
  /// Reading where it comes to rest by itself; 0: nowhere.
  uint32_t centre;
  /// Largest deviation of a resting knob from its mean.
  uint32_t noise;
  /// For encoders: travel of one step, parts of the whole, at most 1; 0: one hundredth.
  float step;
} SinewKnob;

/// One knob moves one control. Several bindings of one knob make a group.
typedef struct SinewBinding {
  /// Index of the knob on the surface.
  uint32_t knob;
  /// The control.
  uint32_t control;
  /// Page on which it holds, from 0; `SINEW_NONE`: on all.
  uint32_t page;
  /// What happens when the control stands elsewhere.
  SinewTakeover takeover;
  /// 0, or 1: clockwise lowers.
  uint32_t inverted;
  /// Shape of the way.
  SinewCurve curve;
  /// Of the curve; not looked at where it is linear.
  float curve_number;
  /// Where rest stands.
  SinewCentre centre;
  /// Share of the travel, at most 0.5; looked at for `SINEW_CENTRE_REST` alone.
  float detent;
  /// Weight at the lower end; with `maximum`, 0 and 0: the control's own stops. Never wider than those.
  float minimum;
  /// Weight at the upper end.
  float maximum;
  /// Fastest change, weight a second; 0: as fast as the hand.
  float slew;
} SinewBinding;

/// Which knobs there are, what they move, and what happens when the device does not behave. With `knob_count` alone the knobs
/// follow the tree of components.
typedef struct SinewSurfaceSettings {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// Knobs of the device, 1 to `SINEW_KNOBS_MAX`.
  size_t knob_count;
  /// The knobs, `knob_count` of them; NULL: not calibrated, and addresses from 0 on.
  const SinewKnob *knobs;
  /// `sizeof(SinewKnob)`; 0 where `knobs` is NULL.
  size_t knob_bytes;
  /// What the knobs move; NULL where `binding_count` is 0.
  const SinewBinding *bindings;
  /// At most `SINEW_BINDINGS_MAX`.
  size_t binding_count;
  /// `sizeof(SinewBinding)`; 0 where there are none.
  size_t binding_bytes;
  /// Index of the first knob that follows the tree; the others are for bindings.
  uint32_t tree_first;
  /// Knobs for coarse components. With `tree_fine`, 0 and 0: without bindings three eighths of the knobs are coarse and
  /// the rest fine; with bindings no knob follows the tree.
  uint32_t tree_coarse;
  /// Knobs behind those for the children of the coarse knob last turned.
  uint32_t tree_fine;
  /// Of the knobs that follow the tree.
  SinewTakeover tree_takeover;
  /// 0: a turn of a coarse knob brings its children; 1: only `SINEW_COMMAND_FOCUS` does.
  uint32_t tree_stays;
  /// Whether a reading far from the last waits until a second confirms it, 0 or 1: for text lines, which have no checksum.
  uint32_t spike_guard;
  /// How long the pose of a device that is gone is held before it eases to rest, microseconds; 0: 5 seconds,
  /// `UINT64_MAX`: for ever.
  uint64_t hold_us;
  /// How long the way to rest takes, microseconds; 0: 2 seconds.
  uint64_t ease_us;
  /// A device that sends all the time and is silent for this long counts as gone, microseconds; 0: never.
  uint64_t silence_us;
} SinewSurfaceSettings;

/// One knob as a display shows it.
typedef struct SinewKnobState {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// Where it stands with its control: of several the first that is not engaged.
  SinewTakeoverState state;
  /// That control; `SINEW_NONE` where there is none.
  uint32_t control;
  /// How far to turn, in travels of the knob; 0 unless it must be turned.
  float distance;
  /// Where the knob stands, calibrated and smoothed, 0 to 1; -1 for encoders, and before its first reading.
  float position;
} SinewKnobState;

/// How a surface and its device are doing.
typedef struct SinewSurfaceStatus {
  /// Set by `SINEW_INIT`.
  size_t struct_bytes;
  /// Readings taken.
  uint64_t readings;
  /// Of those: from addresses that no knob has.
  uint64_t unlisted;
  /// Times the device was lost.
  uint64_t losses;
  /// Whether the device is gone: said to be unplugged, or silent too long. 0 or 1, as those below.
  uint32_t is_lost;
  /// Of that: silent too long, though nobody said unplugged.
  uint32_t is_silent;
  /// It sends, but its noisy knobs do not tremble any more.
  uint32_t is_frozen;
  /// It sends more than it should.
  uint32_t is_flooding;
  /// A stop holds everything at rest, or is on its way there.
  uint32_t is_stopped;
  /// Page of the bindings, from 0.
  uint32_t page;
  /// Pages of the bindings.
  uint32_t page_count;
  /// Tree: the control whose children are on the coarse knobs; `SINEW_NONE`: the coarsest are.
  uint32_t tree_parent;
  /// Tree: the control whose children are on the fine knobs; `SINEW_NONE`: none are.
  uint32_t tree_focus;
  /// Readings that the spike guard threw away.
  uint32_t spikes;
} SinewSurfaceStatus;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/// How much memory a decoder needs; the same for every device.
SinewStatus sinew_decoder_layout(SinewLayout *layout);

/// Opens a decoder at the beginning of a device's bytes. Needs no basis.
///
/// `abi_version`: pass `SINEW_ABI_VERSION`.
/// `settings`: NULL for the usual ones: the first bytes decide what the device speaks.
///
/// Errors: `WRONG_ABI`, `UNKNOWN_OPTION`.
SinewStatus sinew_decoder_open(uint32_t abi_version, const SinewDecoderSettings *settings, void *memory,
                               size_t memory_bytes, SinewDecoder **decoder, SinewDetails *details);

/// What to send to the device now: ask after each `sinew_decoder_feed`, also one without bytes, and write it to the port. A
/// device that waits for a greeting gets one as soon as it is known what it speaks, and again each second until it answers; all
/// others get nothing.
///
/// `now_us`: on the clock of `sinew_decoder_feed`.
/// `bytes`, `capacity`: room for `SINEW_GREETING_BYTES`.
/// `length`: takes the number of bytes written, nearly always 0.
SinewStatus sinew_decoder_greeting(SinewDecoder *decoder, uint64_t now_us, void *bytes, size_t capacity,
                                   size_t *length);

/// Feeds bytes of the device's stream, cut anywhere. Waits for nothing. Bytes that make no sense are counted, never an error.
///
/// `now_us`: when the bytes came, microseconds of a clock of yours that never runs back.
/// `bytes`, `length`: what the port gave; may be none.
/// `taken`: takes how many bytes were used. Fewer than `length` when half of `SINEW_DECODER_READINGS` wait: ask for them,
/// then feed the rest. So no reading of a stream is ever lost here.
SinewStatus sinew_decoder_feed(SinewDecoder *decoder, uint64_t now_us, const void *bytes, size_t length, size_t *taken);

/// Feeds one datagram, whole: OSC as it comes over UDP. What finds no room among the readings that wait is dropped and
/// counted.
///
/// `now_us`: when the datagram came, microseconds of a clock of yours that never runs back.
SinewStatus sinew_decoder_feed_packet(SinewDecoder *decoder, uint64_t now_us, const void *bytes, size_t length);

/// The device was plugged in again: what is half read is thrown away, and the device is greeted anew. Protocol, names, scales
/// and counters stay, so that a knob has the same number as before.
SinewStatus sinew_decoder_replugged(SinewDecoder *decoder);

/// The oldest reading that waits, which then waits no more; `kind` is `SINEW_READING_KIND_NONE` when none does.
SinewStatus sinew_decoder_next(SinewDecoder *decoder, SinewReading *reading);

/// What became of the bytes so far.
///
/// `now_us`: on the clock of `sinew_decoder_feed`, for the age of the last reading.
SinewStatus sinew_decoder_counters(const SinewDecoder *decoder, uint64_t now_us, SinewCounters *counters);

/// What the decoder knows of its device: what it speaks and how sure that is.
SinewStatus sinew_decoder_info(const SinewDecoder *decoder, SinewDeviceInfo *info);

/// What the device calls a knob: its label, OSC address, or from a HELLO; UTF-8, ended by NUL, empty where it has no name.
/// `SINEW_KNOB_NAME_BYTES` are always enough.
SinewStatus sinew_decoder_knob_name(const SinewDecoder *decoder, uint32_t knob, char *name, size_t name_bytes);

/// How much memory a surface with these settings needs. Checks the settings as `sinew_surface_create` does.
///
/// Errors: those of `sinew_surface_create`.
SinewStatus sinew_surface_layout(const SinewBasis *basis, const SinewSurfaceSettings *settings, SinewLayout *layout,
                                 SinewDetails *details);

/// Makes a surface that has heard nothing yet and holds every weight. The settings are copied.
///
/// Errors: `UNKNOWN_OPTION`, `TOO_MANY`, `KNOB_TWICE`, `BAD_READING` (an address above 65535), `BAD_CALIBRATION`, `BAD_STEP`,
/// `NO_SUCH_KNOB`, `NO_SUCH_CONTROL`, `NO_SUCH_PAGE`, `TWO_HANDS`, `BAD_TREE`, `BAD_RESPONSE`.
SinewStatus sinew_surface_create(const SinewBasis *basis, const SinewSurfaceSettings *settings, void *memory,
                                 size_t memory_bytes, SinewSurface **surface, SinewDetails *details);

/// Reads a knob: a reading of `sinew_decoder_next`, or a slider of yours. No control moves before the next
/// `sinew_surface_advance`. A device thought lost that speaks is back. An address that no knob has is counted, not refused.
///
/// Errors: `UNKNOWN_OPTION`, `BAD_READING`.
SinewStatus sinew_surface_read(SinewSurface *surface, const SinewReading *reading);

/// The device is gone: the pose holds, then eases to rest.
SinewStatus sinew_surface_unplugged(SinewSurface *surface, uint64_t now_us);

/// The device is back: nothing moves until each knob has picked up its controls, whatever its takeover. See
/// `sinew_decoder_replugged` too.
SinewStatus sinew_surface_replugged(SinewSurface *surface, uint64_t now_us);

/// Does what a button would: stop, pages.
///
/// `argument`: of `SINEW_COMMAND_FOCUS` and `SINEW_COMMAND_PAGE`; not looked at for the others.
///
/// Errors: `UNKNOWN_OPTION`, `NO_SUCH_CONTROL`, `NO_SUCH_PAGE`.
SinewStatus sinew_surface_command(SinewSurface *surface, SinewCommand command, uint32_t argument);

/// Moves the controls on to `now_us`, once a frame. But where a knob jumps, a control goes no further than its knob did, and
/// never faster than its slew limit. Time that stands still or runs back moves nothing.
///
/// `controls`: of the content that the surface was made for.
///
/// Errors: `FOREIGN_CONTROLS`, `NOT_FINITE` (something wrote over the weights).
SinewStatus sinew_surface_advance(SinewSurface *surface, SinewControls *controls, uint64_t now_us,
                                  SinewDetails *details);

/// One knob, for a display that says "turn left to pick up".
///
/// `knob`: index of the knob on the surface.
///
/// Errors: `NO_SUCH_KNOB`.
SinewStatus sinew_surface_knob(const SinewSurface *surface, uint32_t knob, SinewKnobState *state);

/// How the surface and its device are doing.
SinewStatus sinew_surface_status(const SinewSurface *surface, SinewSurfaceStatus *status);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SINEW_KNOBS_H */
