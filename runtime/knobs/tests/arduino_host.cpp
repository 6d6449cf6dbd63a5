// Compiled by packets.rs: the Arduino header on a host, with a port that prints its bytes in hexadecimal.
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <deque>

class Stream {
 public:
  std::deque<int> incoming;
  int available() { return (int)incoming.size(); }
  int read() {
    const int byte = incoming.front();
    incoming.pop_front();
    return byte;
  }
  size_t write(const uint8_t *bytes, size_t count) {
    for (size_t i = 0; i < count; ++i) std::printf("%02x", bytes[i]);
    return count;
  }
};

#include "SinewKnobs.h"

// What the example sketch needs of an Arduino.
static class : public Stream {
 public:
  void begin(unsigned long) {}
} Serial;
enum { A0, A1, A2, A3, A4, A5, A6, A7 };
static uint16_t analogRead(uint8_t pin) { return (uint16_t)(100 * pin); }
static void delay(unsigned long) {}
// As the IDE says which board was chosen.
#define ARDUINO_AVR_NANO
#include "examples/EightKnobs/EightKnobs.ino"

static void title(const char *text) { std::printf("\n%s ", text); }

int main() {
  Stream port;
  SinewKnobs<2> small(port, "box 1.0", 1023);
  small.name(0, "jaw");
  small.name(1, "brow");
  small.range(0, 12, 1010);
  title("begin");
  small.begin();
  title("values");
  small.set(0, 512);
  small.set(1, 5000);
  small.update();
  title("steps");
  small.turn(1, -3);
  title("asked");
  port.incoming.push_back('x');
  port.incoming.push_back('?');
  small.update();

  title("many");
  static SinewKnobs<255> many(port, "a firmware whose name is longer than it may be", 65535);
  for (int k = 0; k < 255; ++k) {
    many.name((uint8_t)k, "a name just as long as they get, and more");
    many.set((uint8_t)k, (uint16_t)(k * 257));
  }
  many.begin();
  many.update();

  title("wrap");
  SinewKnobs<1> one(port, "", 1);
  one.begin();
  for (int i = 0; i < 600; ++i) one.update();
  title("sketch");
  setup();
  loop();
  std::printf("\n");
}
