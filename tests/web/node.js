// node's side of the comparison between targets: plays a package through the module and prints the checksum of its frames;
// before that, everything that a page could do wrong must be refused with a reason.
"use strict";

const assert = require("node:assert");
const fs = require("node:fs");
const { checksum } = require("./checksum.js");
const { Sinew } = require("../../runtime/web/sinew.js");

async function main([wasm, packagePath, poses]) {
  if (!poses) throw new Error("usage: node tests/web/node.js sinew.wasm PACKAGE POSES");
  const sinew = await Sinew.load(fs.readFileSync(wasm));
  const bytes = fs.readFileSync(packagePath);

  assert.throws(() => sinew.set(0, 0), /no package is open/);
  assert.throws(() => sinew.frame(), /no package is open/);
  assert.strictEqual(sinew.call.sinew_open(), -1, "nothing was reserved");
  assert.strictEqual(sinew.call.sinew_reserve(0xffff_ffff), 0, "more than memory holds");
  for (const length of [0, 1, bytes.length - 1]) assert.throws(() => sinew.open(bytes.subarray(0, length)), Error);
  const damaged = Uint8Array.from(bytes);
  damaged[damaged.length - 1] ^= 1;
  assert.throws(() => sinew.open(damaged), Error);
  assert.throws(() => sinew.reset(), /no package is open/, "a refused package leaves none open");

  sinew.open(bytes);
  const rest = Float32Array.from(sinew.positions);
  assert.ok(rest.some((x) => x !== 0), "opening gives the rest shape");
  assert.strictEqual(sinew.frame(), false, "at rest nothing changes");
  assert.throws(() => sinew.set(sinew.components.length, 0), Error);
  assert.throws(() => sinew.set(0, NaN), Error);
  assert.throws(() => sinew.set(0, Infinity), Error);
  assert.throws(() => sinew.setShare(0, NaN), Error);
  for (const { index, minimum, maximum } of sinew.components) {
    assert.strictEqual(sinew.set(index, 1e9), maximum);
    assert.strictEqual(sinew.set(index, -1e9), minimum);
    assert.strictEqual(sinew.setShare(index, 0), minimum);
    assert.strictEqual(sinew.setShare(index, 1), maximum);
  }
  assert.strictEqual(sinew.frame(), true, "moved controls change the frame");
  sinew.positions[0] += 1;
  const marked = sinew.positions[0];
  assert.strictEqual(sinew.frame(), false);
  assert.strictEqual(sinew.positions[0], marked, "without a change nothing is computed or written");
  assert.ok(sinew.positions.some((x, n) => x !== rest[n]));
  sinew.reset();
  assert.strictEqual(sinew.frame(), true);
  assert.deepStrictEqual(Float32Array.from(sinew.positions), rest, "back to the bits of the rest shape");

  console.log(checksum(sinew, fs.readFileSync(poses, "utf8")));
}

main(process.argv.slice(2)).catch((error) => {
  console.error(error.message);
  process.exit(1);
});
