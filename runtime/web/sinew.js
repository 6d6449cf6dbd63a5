// Sinew in JavaScript: one class over the WebAssembly module, for browsers (a classic script: `Sinew`) and for node
// (`require`). Nothing is copied but names and the package: positions, normals and faces are views of the module's memory.
"use strict";

class Sinew {
  // From the bytes of sinew.wasm, or from a module compiled before. Each instance plays one package at a time.
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

  // Sets a control by a knob that reads 0 to 1023 between the stops; returns the weight it took.
  setKnob(component, knob) {
    return this.#taken(this.call.sinew_set_knob(component, knob));
  }

  // All controls to rest.
  reset() {
    if (this.call.sinew_reset() < 0) throw this.#refusal();
  }

  // Deforms. Returns true when positions and normals have changed.
  frame() {
    const status = this.call.sinew_frame();
    if (status < 0) throw this.#refusal();
    return status === 0;
  }

  // Plays poses, one a line, knobs from 0 to 1023 joined by "|"; returns the checksum of all frames: sixteen digits.
  checksum(poses) {
    let sum = this.call.sinew_checksum_start();
    for (const line of poses.split("\n").filter((line) => line !== "")) {
      line.split("|").forEach((knob, component) => this.setKnob(component, Number(knob)));
      this.frame();
      sum = this.call.sinew_checksum(sum);
    }
    return BigInt.asUintN(64, sum).toString(16).padStart(16, "0");
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
