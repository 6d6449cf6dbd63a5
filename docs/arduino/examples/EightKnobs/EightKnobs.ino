// Eight potentiometers on A0 to A7, sent to Sinew. Copy SinewKnobs.h beside this file, or the folder `arduino` into your
// `libraries` folder under the name SinewKnobs.
#include "SinewKnobs.h"

const uint8_t KNOBS = 8;
const uint8_t PINS[KNOBS] = {A0, A1, A2, A3, A4, A5, A6, A7};

SinewKnobs<KNOBS> knobs(Serial, "EightKnobs 1.0", 1023);

void setup() {
  Serial.begin(115200);
  knobs.name(0, "jaw");
  knobs.name(1, "brow left");
  knobs.name(2, "brow right");
  knobs.range(0, 12, 1010);  // what this pot really reaches; leave it out if you do not know it
  knobs.begin();
}

void loop() {
  for (uint8_t k = 0; k < KNOBS; ++k) {
    knobs.set(k, analogRead(PINS[k]));
  }
  knobs.update();
  delay(5);
}
