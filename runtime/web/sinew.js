// Sinew in JavaScript: one class over the WebAssembly module, for browsers (a classic script: `Sinew`) and for node
// (`require`). Nothing is copied but names and the package: positions, normals and faces are views of the module's memory.
"use strict";

class Sinew {
  // Which of the two builds this engine can run: the one with vectors of four numbers, or the one without, which is slower and
  // plays the same bits.
  static fileName() {
    // () -> v128, of a splat: refused where there are no vectors.
    const types = [1, 5, 1, 0x60, 0, 1, 0x7b];
    const code = [10, 8, 1, 6, 0, 0x41, 0, 0xfd, 15, 0x0b];
    const header = [0, 0x61, 0x73, 0x6d, 1, 0, 0, 0];
    const hasVectors = WebAssembly.validate(Uint8Array.from([...header, ...types, 3, 2, 1, 0, ...code]));
    return hasVectors ? "sinew.wasm" : "sinew-scalar.wasm";
  }

  // From the bytes of the file that `fileName` names, or from a module compiled before. Each instance plays one package at a time.
  static async load(source) {
    const module = source instanceof WebAssembly.Module ? source : await WebAssembly.compile(source);
    return new Sinew((await WebAssembly.instantiate(module, {})).exports);
  }

  constructor(exports) {
    this.call = exports;
    this.components = [];
  }

  // Opens a baked package. Throws an Error that says why not; then nothing is open.
  // Afterwards `vertexCount`, `faceCount`, `components`, `positions`, `normals` and `faces` are those of the package.
  open(packageBytes) {
    const { call } = this;
    this.vertexCount = this.faceCount = 0;
    this.components = [];
    this.positions = this.normals = this.faces = null;
    const bytes = new Uint8Array(packageBytes);
    const address = call.sinew_reserve(bytes.length) >>> 0;
    if (address === 0) throw this.#refusal();
    new Uint8Array(call.memory.buffer, address, bytes.length).set(bytes);
    if (call.sinew_open() < 0) throw this.#refusal();

    this.vertexCount = call.sinew_vertex_count() >>> 0;
    this.faceCount = call.sinew_face_count() >>> 0;
    // Memory grows only in the calls above, so that these views stay good until the next `open`.
    const { buffer } = call.memory;
    this.positions = new Float32Array(buffer, call.sinew_positions() >>> 0, 3 * this.vertexCount);
    this.normals = new Float32Array(buffer, call.sinew_normals() >>> 0, 3 * this.vertexCount);
    this.faces = new Uint32Array(buffer, call.sinew_faces() >>> 0, 3 * this.faceCount);
    const count = call.sinew_component_count() >>> 0;
    this.components = Array.from({ length: count }, (_, index) => ({
      index,
      name: this.#text(call.sinew_component_name(index), call.sinew_component_name_bytes(index)),
      parent: call.sinew_component_parent(index),
      minimum: call.sinew_component_minimum(index),
      maximum: call.sinew_component_maximum(index),
    }));
  }

  // Sets a control, clamped between its stops; returns the weight it took.
  set(component, weight) {
    return this.#taken(this.call.sinew_set_control(component, weight));
  }

  // Sets a control by the share of its way from the lower stop, 0, to the upper one, 1; returns the weight it took.
  setShare(component, share) {
    return this.#taken(this.call.sinew_set_share(component, share));
  }

  // All controls to rest.
  reset() {
    if (this.call.sinew_reset() < 0) throw this.#refusal();
  }

  // The weight of a control.
  weight(component) {
    return this.#taken(this.call.sinew_weight(component));
  }

  // Takes hold of a vertex where the last frame has it; `drag` moves it, and every held vertex keeps its place as well as it can.
  hold(vertex) {
    if (this.call.sinew_hold(vertex) < 0) throw this.#refusal();
  }

  letGo(vertex) {
    if (this.call.sinew_let_go(vertex) < 0) throw this.#refusal();
  }

  // Moves the weights so that a held vertex comes to a point, [x, y, z] in units of the source.
  drag(vertex, [x, y, z]) {
    if (this.call.sinew_drag(vertex, x, y, z) < 0) throw this.#refusal();
  }

  // Deforms. Returns true when positions and normals have changed.
  frame() {
    const status = this.call.sinew_frame();
    if (status < 0) throw this.#refusal();
    return status === 0;
  }

  #taken(weight) {
    if (Number.isNaN(weight)) throw this.#refusal();
    return weight;
  }

  #refusal() {
    return new Error(this.#text(this.call.sinew_message(), this.call.sinew_message_bytes()));
  }

  #text(address, length) {
    return new TextDecoder().decode(new Uint8Array(this.call.memory.buffer, address >>> 0, length >>> 0));
  }
}

if (typeof module !== "undefined") module.exports = { Sinew };
