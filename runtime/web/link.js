// The way to a stage, and back: a WebSocket that brings weights and takes what this page asks. Its messages are described in
// runtime/stage/src/page/message.rs.
"use strict";

const FRAME_VERSION = 1;
const STATES = ["engaged", "turn left", "turn right", "held", "not heard"];
const RETRY_MS = [500, 1000, 2000, 5000];

class Link {
  // `listener`: { hello, frame, state, lost, refused }, called with what came.
  constructor(listener) {
    this.listener = listener;
    this.wanted = new Map(); // weights to send: component -> weight
    this.tries = 0;
    this.isOpen = false;
  }

  // Resolves to whether there is a stage at this address; from then on the link is kept.
  connect() {
    return new Promise((resolve) => {
      const token = new URLSearchParams(location.search).get("token");
      const url = new URL("socket", location.href);
      url.protocol = url.protocol.replace("http", "ws");
      url.search = token ? `?token=${encodeURIComponent(token)}` : "";
      url.hash = "";
      const socket = new WebSocket(url);
      socket.binaryType = "arraybuffer";
      this.socket = socket;
      socket.onmessage = ({ data }) => {
        if (typeof data !== "string") {
          this.#frame(data);
          return;
        }
        const message = JSON.parse(data);
        if (message.type === "hello" && message.version !== FRAME_VERSION) {
          this.listener.refused(`The stage speaks version ${message.version} and this page ${FRAME_VERSION}: load the page again.`);
          this.isRefused = true;
          socket.close();
        } else if (message.type === "hello") {
          [this.isOpen, this.tries] = [true, 0];
          this.hello = message;
          this.listener.hello(message);
          resolve(true);
        } else if (message.type === "state") {
          this.listener.state(message);
        }
      };
      socket.onclose = () => {
        resolve(false);
        if (!this.hello || this.isRefused) return; // no stage here
        if (this.isOpen) this.listener.lost();
        this.isOpen = false;
        const wait = RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)];
        setTimeout(() => this.connect(), wait);
      };
    });
  }

  // A weight, with the others of this picture in one message.
  set(component, weight) {
    if (this.wanted.size === 0) requestAnimationFrame(() => this.#flush());
    this.wanted.set(component, weight);
  }

  ask(what) {
    if (this.isOpen) this.socket.send(JSON.stringify(what));
  }

  #flush() {
    // Several messages where one would be too long for the stage.
    const weights = [...this.wanted];
    this.wanted.clear();
    for (let n = 0; n < weights.length; n += 1000) this.ask({ ask: "set", weights: weights.slice(n, n + 1000) });
  }

  #frame(buffer) {
    const head = new Uint32Array(buffer, 0, 5);
    const [version, number, weightCount, knobCount, assignmentCount] = head;
    if (version !== FRAME_VERSION) return;
    const weights = new Float32Array(buffer, 20, weightCount);
    const knobs = new Float32Array(buffer, 20 + 4 * weightCount, knobCount);
    const view = new DataView(buffer, 20 + 4 * (weightCount + knobCount));
    const assignments = Array.from({ length: assignmentCount }, (_, n) => ({
      knob: view.getUint16(16 * n, true),
      component: view.getUint16(16 * n + 2, true),
      state: STATES[view.getUint32(16 * n + 4, true)] ?? "held",
      weight: view.getFloat32(16 * n + 8, true),
      distance: view.getFloat32(16 * n + 12, true),
    }));
    this.listener.frame({ number, weights, knobs, assignments });
  }
}
