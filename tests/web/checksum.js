// Plays fixed poses and sums up the frames as the other targets do: FNV-1a, 64 bits wide, over the bits of positions, then
// normals, of one frame after another. For node (`require`) and for a page that holds Sinew already.
"use strict";

const FULL_SCALE = 1023;

// `poses`: one a line, knobs from 0 to FULL_SCALE joined by "|". Returns sixteen digits.
function checksum(sinew, poses) {
  // The sum in two halves of 32 bits, times 2^40 + 0x1b3.
  let [low, high] = [0x84222325, 0xcbf29ce4];
  const add = (view) => {
    for (const byte of new Uint8Array(view.buffer, view.byteOffset, view.byteLength)) {
      low = (low ^ byte) >>> 0;
      const product = low * 0x1b3;
      high = (Math.imul(high, 0x1b3) + Math.floor(product / 2 ** 32) + (low << 8)) >>> 0;
      low = product >>> 0;
    }
  };
  for (const line of poses.split("\n").filter((line) => line !== "")) {
    line.split("|").forEach((knob, component) => sinew.setShare(component, Number(knob) / FULL_SCALE));
    sinew.frame();
    add(sinew.positions);
    add(sinew.normals);
  }
  return [high, low].map((half) => half.toString(16).padStart(8, "0")).join("");
}

if (typeof module !== "undefined") module.exports = { checksum };
