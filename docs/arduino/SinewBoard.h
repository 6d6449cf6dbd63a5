// SinewBoard.h: the analog pins of the board that is chosen in the IDE, and the largest value that they read.
//
//   SINEW_PINS        how many there are
//   sinew_pin(k)      pin k, for analogRead
//   SINEW_FULL_SCALE  what a pot reads at its end
//   sinew_begin()     call it in setup(): boards that could read finer do
//
// Pins that a board has on its legs, no others: a pin without a pot floats, and would move things.
#ifndef SINEW_BOARD_H
#define SINEW_BOARD_H

#if defined(ARDUINO)
#include <Arduino.h>
#endif

#if defined(ARDUINO_AVR_MEGA2560) || defined(ARDUINO_AVR_MEGA) || defined(ARDUINO_AVR_NANO)
static const uint8_t sinew_pins[] = {A0, A1, A2, A3, A4, A5, A6, A7};
#define SINEW_FULL_SCALE 1023
#elif defined(CONFIG_IDF_TARGET_ESP32)
// The first converter alone: the second one does not work beside Wi-Fi.
static const uint8_t sinew_pins[] = {36, 39, 34, 35, 32, 33};
#define SINEW_FULL_SCALE 4095
#elif defined(ARDUINO_ARCH_ESP32)
static const uint8_t sinew_pins[] = {A0, A1, A2, A3};
#define SINEW_FULL_SCALE 4095
#elif defined(ARDUINO_ARCH_RP2040)
static const uint8_t sinew_pins[] = {A0, A1, A2};
#define SINEW_FULL_SCALE 4095
#elif defined(ARDUINO_ARCH_RENESAS)
static const uint8_t sinew_pins[] = {A0, A1, A2, A3, A4, A5};
#define SINEW_FULL_SCALE 4095
#else  // Uno and its kin
static const uint8_t sinew_pins[] = {A0, A1, A2, A3, A4, A5};
#define SINEW_FULL_SCALE 1023
#endif

static const uint8_t SINEW_PINS = sizeof(sinew_pins);

inline uint8_t sinew_pin(uint8_t k) { return sinew_pins[k]; }

inline void sinew_begin() {
#if SINEW_FULL_SCALE > 1023
  analogReadResolution(12);
#endif
}

#endif
