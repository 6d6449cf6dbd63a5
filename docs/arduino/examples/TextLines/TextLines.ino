// Potentiometers on the analog pins, sent as text, the way of deej: 512|0|1023. Needs no library but SinewBoard.h; without it, write
// your pins into the two lines that name it. Packets (EightKnobs) are better for a show: text has no checksum.
#include "SinewBoard.h"

void setup() {
  sinew_begin();
  Serial.begin(9600);
}

void loop() {
  for (uint8_t k = 0; k < SINEW_PINS; ++k) {
    if (k > 0) Serial.print('|');
    Serial.print(analogRead(sinew_pin(k)));
  }
  Serial.print("\r\n");
  delay(10);
}
