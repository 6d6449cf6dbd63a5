// One encoder and two buttons beside the pots. Knob 0 is the encoder, knobs 1 and 2 are the buttons, the pots follow. In the mapping
// file a button is a [[button]] with its number; see docs/knobs.toml.
#include "SinewBoard.h"
#include "SinewKnobs.h"

// Encoder: its outer legs to these pins, the middle one to GND. Buttons: one leg to the pin, the other to GND.
const uint8_t ENCODER_A = 2, ENCODER_B = 3;
const uint8_t BUTTONS[2] = {4, 5};
const uint8_t FIRST_POT = 3;

SinewKnobs<FIRST_POT + sizeof(sinew_pins)> knobs(Serial, "ButtonsAndEncoders 1.0", SINEW_FULL_SCALE);

uint8_t last_state = 0;
int8_t quarter_steps = 0;
uint32_t sent_ms = 0;

// Quarter steps by the last two states of the two contacts; a bounce goes there and back and counts nothing.
const int8_t WAY[16] = {0, -1, 1, 0, 1, 0, 0, -1, -1, 0, 0, 1, 0, 1, -1, 0};

void turn() {
  const uint8_t state = (uint8_t)(digitalRead(ENCODER_A) << 1 | digitalRead(ENCODER_B));
  quarter_steps += WAY[last_state << 2 | state];
  last_state = state;
  if (quarter_steps >= 4 || quarter_steps <= -4) {
    knobs.turn(0, quarter_steps / 4);
    quarter_steps %= 4;
  }
}

void setup() {
  sinew_begin();
  pinMode(ENCODER_A, INPUT_PULLUP);
  pinMode(ENCODER_B, INPUT_PULLUP);
  last_state = (uint8_t)(digitalRead(ENCODER_A) << 1 | digitalRead(ENCODER_B));
  for (uint8_t b = 0; b < 2; ++b) pinMode(BUTTONS[b], INPUT_PULLUP);
  Serial.begin(115200);
  knobs.name(0, "wheel");
  knobs.name(1, "stop");
  knobs.name(2, "next");
  knobs.begin();
}

void loop() {
  turn();
  if (millis() - sent_ms < 5) return;
  sent_ms = millis();
  for (uint8_t b = 0; b < 2; ++b) knobs.set(1 + b, digitalRead(BUTTONS[b]) == LOW ? SINEW_FULL_SCALE : 0);
  for (uint8_t k = 0; k < SINEW_PINS; ++k) knobs.set(FIRST_POT + k, analogRead(sinew_pin(k)));
  knobs.update();
}
