// Sinew for three.js: a Mesh that plays a baked package. `SinewLoader` makes one from a URL; its frames run here, in
// WebAssembly, or in a worker (`WorkerPlayer`), where the page's thread only uploads what comes back.

import { BufferAttribute, BufferGeometry, DynamicDrawUsage, FileLoader, Loader, Mesh, MeshStandardMaterial } from "three";
import { Sinew } from "./sinew.js";

export { Sinew };

const WASM = new URL("./sinew.wasm", import.meta.url);
const compiled = new Map();

/** The compiled module, once for each address. */
function compile(wasm) {
  const address = String(wasm);
  if (!compiled.has(address)) {
    const module = fetch(address).then((response) => {
      if (!response.ok) throw new Error(`${address}: ${response.status} ${response.statusText}`);
      return response.arrayBuffer();
    }).then((bytes) => WebAssembly.compile(bytes));
    // A later try may succeed.
    module.catch(() => compiled.delete(address));
    compiled.set(address, module);
  }
  return compiled.get(address);
}

/** Opens a package on this thread: the result is what a `SinewMesh` plays. */
export async function open(packageBytes, wasm = WASM) {
  const player = await Sinew.load(await compile(wasm));
  player.open(packageBytes);
  return player;
}

/** Plays a package in a worker of its own. `frame()` never waits: it brings what has come and asks for what is due. */
export class WorkerPlayer {
  #worker;
  #weights;
  #due = false;
  #waiting = false;
  #arrived = false;
  #spare;
  #error = null;

  static async open(packageBytes, wasm = WASM) {
    const module = await compile(wasm);
    const worker = new Worker(new URL("./worker.js", import.meta.url), { type: "module" });
    const bytes = new Uint8Array(packageBytes).slice();
    try {
      const opened = await new Promise((resolve, reject) => {
        worker.onmessage = ({ data }) => (data.error === undefined ? resolve(data) : reject(new Error(data.error)));
        worker.onerror = (event) => reject(new Error(event.message ?? "the worker does not start"));
        worker.postMessage({ module, bytes }, [bytes.buffer]);
      });
      return new WorkerPlayer(worker, opened);
    } catch (error) {
      worker.terminate();
      throw error;
    }
  }

  constructor(worker, { components, faces, positions, normals }) {
    this.#worker = worker;
    this.components = components;
    this.faces = faces;
    this.positions = positions;
    this.normals = normals;
    this.vertexCount = positions.length / 3;
    this.faceCount = faces.length / 3;
    this.#weights = new Float32Array(components.length);
    this.#spare = { positions: positions.slice(), normals: normals.slice() };
    worker.onmessage = ({ data }) => this.#take(data);
    worker.onerror = (event) => (this.#error = new Error(event.message ?? "the worker has ended"));
  }

  set(component, weight) {
    const { minimum, maximum } = componentAt(this.components, component);
    if (!Number.isFinite(weight)) throw new Error(`the weight of a control is ${weight}`);
    this.#due = true;
    return (this.#weights[component] = Math.min(Math.max(weight, minimum), maximum));
  }

  reset() {
    this.#weights.fill(0);
    this.#due = true;
  }

  /** True when `positions` and `normals` are those of a newer pose. Throws what went wrong in the worker. */
  frame() {
    if (this.#error !== null) throw this.#error;
    if (this.#due && !this.#waiting) {
      this.#due = false;
      this.#waiting = true;
      const { positions, normals } = this.#spare;
      const weights = this.#weights.slice();
      this.#worker.postMessage({ weights, positions, normals }, [weights.buffer, positions.buffer, normals.buffer]);
    }
    const arrived = this.#arrived;
    this.#arrived = false;
    return arrived;
  }

  /** Ends the worker. */
  close() {
    this.#worker.terminate();
    this.#error = new Error("the player is closed");
  }

  #take({ error, positions, normals }) {
    if (error !== undefined) {
      this.#error = new Error(error);
      return;
    }
    this.#spare = { positions: this.positions, normals: this.normals };
    this.positions = positions;
    this.normals = normals;
    this.#waiting = false;
    this.#arrived = true;
  }
}

function componentAt(components, index) {
  const component = components[index];
  if (component === undefined) throw new Error(`there is no control ${index}; the package has ${components.length}`);
  return component;
}

/** A mesh that a package plays on. Call `update()` once a frame. */
export class SinewMesh extends Mesh {
  #indices;

  /** `player`: an opened `Sinew` or `WorkerPlayer`, of this mesh alone. */
  constructor(player, material = new MeshStandardMaterial()) {
    const geometry = new BufferGeometry();
    for (const [name, array] of [["position", player.positions], ["normal", player.normals]]) {
      geometry.setAttribute(name, new BufferAttribute(array, 3).setUsage(DynamicDrawUsage));
    }
    geometry.setIndex(new BufferAttribute(player.faces, 1));
    super(geometry, material);
    this.type = "SinewMesh";
    this.player = player;
    this.controls = player.components;
    this.weights = new Float32Array(this.controls.length);
    this.#indices = new Map(this.controls.map(({ name, index }) => [name, index]));
    this.update();
  }

  /** Index of a control, from its name or itself. Throws where there is none. */
  indexOf(control) {
    const index = typeof control === "number" ? control : this.#indices.get(control);
    if (this.controls[index] === undefined) throw new Error(`the package has no control "${control}"`);
    return index;
  }

  /** Sets a weight, clamped to the range seen in training; returns what it took. */
  setWeight(control, weight) {
    const index = this.indexOf(control);
    return (this.weights[index] = this.player.set(index, weight));
  }

  /** All weights to 0. */
  reset() {
    this.player.reset();
    this.weights.fill(0);
  }

  /** Plays the weights where they have changed; true when there is a new shape to draw. */
  update() {
    if (!this.player.frame()) return false;
    const { position, normal } = this.geometry.attributes;
    position.array = this.player.positions;
    normal.array = this.player.normals;
    position.needsUpdate = normal.needsUpdate = true;
    // three.js makes them anew when it needs them.
    this.geometry.boundingSphere = this.geometry.boundingBox = null;
    return true;
  }

  /** Gives the geometry's buffers on the GPU back, and ends the worker where there is one. The material is the caller's. */
  dispose() {
    this.geometry.dispose();
    this.player.close?.();
  }
}

/** Loads baked packages: `await new SinewLoader().loadAsync("walk.baked.sinew")`. */
export class SinewLoader extends Loader {
  #wasm = WASM;
  #inWorker = false;

  /** Where `sinew.wasm` is, for servers that put it elsewhere. */
  setWasm(url) {
    this.#wasm = url;
    return this;
  }

  /** Whether frames run in a worker, one for each mesh. */
  setWorker(inWorker) {
    this.#inWorker = inWorker;
    return this;
  }

  load(url, onLoad, onProgress, onError) {
    const files = new FileLoader(this.manager).setPath(this.path).setResponseType("arraybuffer");
    files.setRequestHeader(this.requestHeader).setWithCredentials(this.withCredentials);
    const failed = (error) => {
      if (onError) onError(error);
      else console.error(error);
      this.manager.itemError(url);
    };
    const loaded = async (bytes) => {
      try {
        onLoad(await this.parse(bytes));
      } catch (error) {
        failed(error);
      }
    };
    files.load(url, loaded, onProgress, failed);
  }

  /** A mesh from a package's bytes. Rejects, with the reason, where they are none. */
  async parse(packageBytes) {
    const player = this.#inWorker ? WorkerPlayer.open(packageBytes, this.#wasm) : open(packageBytes, this.#wasm);
    return new SinewMesh(await player);
  }
}
