// Frames in node: the module with vectors beside the one without, in turns, so that a slow moment of the machine hits both.
//   runtime/web/build && node runtime/benches/web.js target/web PACKAGE [ROUNDS]
"use strict";

const fs = require("node:fs");
const path = require("node:path");
const { Sinew } = require("../web/sinew.js");

const quantile = (sorted, q) => sorted[Math.round((sorted.length - 1) * q)];

async function main([folder, packagePath, rounds = 300]) {
  if (!packagePath) throw new Error("usage: node runtime/benches/web.js FOLDER PACKAGE [ROUNDS]");
  const contenders = [];
  for (const name of ["sinew.wasm", "sinew-scalar.wasm"]) {
    const sinew = await Sinew.load(fs.readFileSync(path.join(folder, name)));
    sinew.open(fs.readFileSync(packagePath));
    contenders.push({ name, sinew, samples: [] });
  }
  const [{ sinew: first }] = contenders;
  console.log(`${first.vertexCount} vertices, ${first.components.length} components, all of them moving; microseconds`);
  for (let round = 0; round < rounds; round += 1) {
    for (const { sinew, samples } of contenders) {
      sinew.components.forEach(({ index }) => sinew.setShare(index, 0.5 + 0.5 * Math.sin(0.1 * round + index)));
      const start = process.hrtime.bigint();
      sinew.frame();
      samples.push(Number(process.hrtime.bigint() - start) / 1e3);
    }
  }
  const medians = contenders.map(({ name, samples }) => {
    const sorted = samples.slice(rounds / 10).sort((a, b) => a - b);
    const [median, tail] = [quantile(sorted, 0.5), quantile(sorted, 0.99)];
    console.log(`${name.padEnd(20)} p50 ${median.toFixed(0).padStart(7)}  p99 ${tail.toFixed(0).padStart(7)}`);
    return median;
  });
  console.log(`without vectors ${(medians[1] / medians[0]).toFixed(2)} times as long`);
}

main(process.argv.slice(2)).catch((error) => {
  console.error(error.message);
  process.exit(1);
});
