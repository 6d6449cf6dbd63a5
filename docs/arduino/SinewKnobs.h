// SinewKnobs.h: sends knobs to Sinew as framed packets, version 1. One header, C++11, needs only Arduino's Stream.
// The specification is docs/knob-protocol.md of the Sinew project; a test compares the bytes of this file with its vectors.
//
//   SinewKnobs<8> knobs(Serial, "my box 1.0", 1023);
//   void setup() { Serial.begin(115200); knobs.name(0, "jaw"); knobs.begin(); }
//   void loop()  { knobs.set(0, analogRead(A0)); knobs.update(); delay(5); }
#ifndef SINEW_KNOBS_H
#define SINEW_KNOBS_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>
#if defined(ARDUINO)
#include <Arduino.h>
#endif

// KNOBS: 1 to 255. Memory on an 8-bit board: 8 bytes a knob and 265 for the frame and the rest.
// Port: anything with Arduino's `int available()`, `int read()` and `size_t write(const uint8_t*, size_t)`.
template <uint8_t KNOBS, class Port = Stream>
class SinewKnobs {
 public:
  // firmware: at most 32 bytes of text; full_scale: the largest value, 1023 for ten bits.
  SinewKnobs(Port &port, const char *firmware, uint16_t full_scale)
      : port_(port), firmware_(firmware), full_scale_(full_scale ? full_scale : 1), sequence_(0), since_hello_(0) {
    for (uint8_t k = 0; k < KNOBS; ++k) {
      names_[k] = "";
      low_[k] = 0;
      high_[k] = full_scale_;
      values_[k] = 0;
    }
  }

  // Names a knob: at most 24 bytes of text that stays in memory.
  void name(uint8_t knob, const char *text) {
    if (knob < KNOBS) names_[knob] = text;
  }

  // Says which part of the scale the knob sweeps, if it is not all of it.
  void range(uint8_t knob, uint16_t low, uint16_t high) {
    if (knob < KNOBS) {
      low_[knob] = low;
      high_[knob] = high;
    }
  }

  // Call at the end of setup(). Closes whatever a boot loader printed, and introduces the box.
  void begin() {
    const uint8_t boundary = 0;
    port_.write(&boundary, 1);
    hello(FLAG_STARTED);
  }

  // Keeps a reading for the next update(). Readings above the full scale are cut to it.
  void set(uint8_t knob, uint16_t value) {
    if (knob < KNOBS) values_[knob] = value < full_scale_ ? value : full_scale_;
  }

  // Sends the steps of an encoder at once; positive is clockwise.
  void turn(uint8_t knob, int16_t steps) {
    if (knob >= KNOBS) return;
    uint8_t *payload = start(KIND_STEPS);
    payload[0] = knob;
    payload[1] = 1;
    word(payload + 2, (uint16_t)steps);
    finish(4);
  }

  // Sends all positions. Call once a loop: it also answers a host that asks, and repeats the introduction now and then.
  void update() {
    bool asked = since_hello_ >= HELLO_EVERY;
    while (port_.available() > 0) asked |= port_.read() == HELLO_REQUEST;
    if (asked) hello(0);
    ++since_hello_;
    for (uint8_t first = 0; first < KNOBS;) {
      const uint8_t left = KNOBS - first;
      uint8_t count = left;
      if (count > VALUES_MAX) count = VALUES_MAX;
      uint8_t *payload = start(KIND_VALUES);
      payload[0] = first;
      payload[1] = count;
      word(payload + 2, full_scale_);
      for (uint8_t i = 0; i < count; ++i) word(payload + 4 + 2 * i, values_[first + i]);
      finish(4 + 2 * count);
      if (left <= VALUES_MAX) break;
      first += count;
    }
  }

 private:
  enum : uint8_t {
    VERSION = 1,
    KIND_VALUES = 1,
    KIND_STEPS = 2,
    KIND_HELLO = 3,
    FLAG_STARTED = 1,
    HELLO_REQUEST = '?',
    HEADER_BYTES = 3,
    FRAME_BYTES_MAX = 254,
    VALUES_MAX = (254 - 3 - 4 - 2) / 2,
    FIRMWARE_BYTES_MAX = 32,
    NAME_BYTES_MAX = 24,
  };
  static const uint16_t HELLO_EVERY = 256;

  static void word(uint8_t *out, uint16_t value) {
    out[0] = (uint8_t)(value & 0xff);
    out[1] = (uint8_t)(value >> 8);
  }

  static uint8_t length(const char *text, uint8_t length_max) {
    const size_t bytes = strlen(text);
    if (bytes <= length_max) return (uint8_t)bytes;
    uint8_t cut = length_max;
    while (cut > 0 && ((uint8_t)text[cut] & 0xc0) == 0x80) --cut;  // not inside a character
    return cut;
  }

  static uint16_t crc(const uint8_t *bytes, uint8_t count) {
    uint16_t crc = 0xffff;
    for (uint8_t i = 0; i < count; ++i) {
      crc ^= (uint16_t)((uint16_t)bytes[i] << 8);
      for (uint8_t bit = 0; bit < 8; ++bit) crc = (uint16_t)((crc & 0x8000) ? (crc << 1) ^ 0x1021 : crc << 1);
    }
    return crc;
  }

  // The first byte of frame_ is the first of the byte stuffing; returns where the payload goes.
  uint8_t *start(uint8_t kind) {
    frame_[1] = VERSION;
    frame_[2] = kind;
    frame_[3] = sequence_++;
    return frame_ + 1 + HEADER_BYTES;
  }

  // Adds the checksum, stuffs in place and sends. A frame of at most 254 bytes is one block: a single byte more.
  void finish(uint8_t payload_bytes) {
    uint8_t bytes = HEADER_BYTES + payload_bytes;
    word(frame_ + 1 + bytes, crc(frame_ + 1, bytes));
    bytes += 2;
    uint8_t zero_at = 0;
    for (uint8_t i = 1; i <= bytes; ++i) {
      if (frame_[i] == 0) {
        frame_[zero_at] = i - zero_at;
        zero_at = i;
      }
    }
    frame_[zero_at] = bytes + 1 - zero_at;
    frame_[bytes + 1] = 0;
    port_.write(frame_, (size_t)bytes + 2);
  }

  void hello(uint8_t flags) {
    since_hello_ = 0;
    uint8_t knob = 0;
    do {
      uint8_t *payload = start(KIND_HELLO);
      const uint8_t firmware_bytes = length(firmware_, FIRMWARE_BYTES_MAX);
      payload[0] = flags;
      payload[1] = KNOBS;
      payload[2] = knob;
      payload[3] = 0;
      payload[4] = firmware_bytes;
      memcpy(payload + 5, firmware_, firmware_bytes);
      uint8_t bytes = 5 + firmware_bytes;
      while (knob < KNOBS) {
        const uint8_t name_bytes = length(names_[knob], NAME_BYTES_MAX);
        if (HEADER_BYTES + bytes + 5 + name_bytes + 2 > FRAME_BYTES_MAX) break;
        word(payload + bytes, low_[knob]);
        word(payload + bytes + 2, high_[knob]);
        payload[bytes + 4] = name_bytes;
        memcpy(payload + bytes + 5, names_[knob], name_bytes);
        bytes += 5 + name_bytes;
        ++payload[3];
        ++knob;
      }
      finish(bytes);
      flags = 0;  // only the first frame begins the count
    } while (knob < KNOBS);
  }

  Port &port_;
  const char *firmware_;
  uint16_t full_scale_;
  uint8_t sequence_;
  uint16_t since_hello_;
  const char *names_[KNOBS];
  uint16_t low_[KNOBS], high_[KNOBS], values_[KNOBS];
  uint8_t frame_[256];
};

#endif
