// The other side of `WorkerPlayer`: opens one package, then answers weights with vertices.

import { Sinew } from "./sinew.js";

let sinew;

async function answer({ module, bytes, weights, positions, normals }) {
  if (module !== undefined) {
    const opened = await Sinew.load(module);
    opened.open(bytes);
    sinew = opened;
    return [{
      components: sinew.components,
      faces: sinew.faces.slice(),
      positions: sinew.positions.slice(),
      normals: sinew.normals.slice(),
    }, []];
  }
  weights.forEach((weight, component) => sinew.set(component, weight));
  sinew.frame();
  positions.set(sinew.positions);
  normals.set(sinew.normals);
  return [{ positions, normals }, [positions.buffer, normals.buffer]];
}

self.onmessage = async ({ data }) => {
  try {
    const [message, moved] = await answer(data);
    self.postMessage(message, moved);
  } catch (error) {
    self.postMessage({ error: error.message });
  }
};
