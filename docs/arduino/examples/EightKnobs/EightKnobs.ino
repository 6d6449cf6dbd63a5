// Potentiometers on the analog pins, sent to Sinew as packets: as many as the board has, six on an Uno, eight on a Nano or a Mega.
// Put the folder `arduino` into your `libraries` folder under the name SinewKnobs.
#include "SinewBoard.h"
#include "SinewKnobs.h"

SinewKnobs<sizeof(sinew_pins)> knobs(Serial, "EightKnobs 1.1", SINEW_FULL_SCALE);

void setup() {
  sinew_begin();
  Serial.begin(115200);
  knobs.name(0, "jaw");
  knobs.name(1, "brow left");
  knobs.name(2, "brow right");
  knobs.begin();
}

void loop() {
  for (uint8_t k = 0; k < SINEW_PINS; ++k) {
    knobs.set(k, analogRead(sinew_pin(k)));
  }
  knobs.update();
  delay(5);
}
