// Hands on the mesh: a press on it takes hold of the nearest vertex, a drag moves the weights so that it follows, a shift-click pins
// a vertex where it is. Held vertices are solved by the runtime; this file finds them under the pointer.
"use strict";

// How near to a vertex a press must be, in CSS pixels: a finger needs more.
const REACH = { mouse: 14, pen: 14, touch: 30 };

class Grab {
  // `hands`: { begin(), moved() }: a hand begins; the weights have changed.
  constructor(view, hands) {
    Object.assign(this, { view, hands });
    this.pins = new Map(); // vertex -> its dot
    this.held = null; // { pointer, vertex, depth }
  }

  // The mesh that is played, or none.
  setMesh(sinew) {
    this.letGo();
    this.sinew = sinew;
  }

  // Takes a press if it is on the mesh. Returns whether it did.
  press(event) {
    if (!this.sinew || this.held || event.button !== 0) return false;
    const { offsetX: x, offsetY: y } = event;
    const found = this.view.vertexAt(this.sinew.positions, this.sinew.normals, x, y, REACH[event.pointerType] ?? 14);
    if (found === null) return false;
    this.hands.begin();
    if (event.shiftKey) {
      this.#pin(found.vertex);
      return true;
    }
    const isPinned = this.pins.has(found.vertex);
    if (!isPinned && !this.#try(() => this.sinew.hold(found.vertex))) return false;
    this.held = { pointer: event.pointerId, isPinned, ...found };
    return true;
  }

  // Follows a pointer that holds a vertex. Returns whether it does.
  drag(event) {
    if (this.held?.pointer !== event.pointerId) return false;
    const target = this.view.pointAt(event.offsetX, event.offsetY, this.held.depth);
    if (this.#try(() => this.sinew.drag(this.held.vertex, target))) this.hands.moved();
    return true;
  }

  release(event) {
    if (this.held?.pointer !== event.pointerId) return;
    if (!this.held.isPinned) this.#try(() => this.sinew.letGo(this.held.vertex));
    this.held = null;
  }

  // Every pin, and what is in the hand.
  letGo() {
    for (const [vertex, dot] of this.pins) {
      this.#try(() => this.sinew.letGo(vertex));
      dot.remove();
    }
    this.pins.clear();
    if (this.held && !this.held.isPinned) this.#try(() => this.sinew.letGo(this.held.vertex));
    this.held = null;
  }

  // Moves the dots with the mesh.
  place() {
    for (const [vertex, dot] of this.pins) {
      const [x, y] = this.view.screenOf(this.sinew.positions, vertex);
      dot.style.left = `${x}px`;
      dot.style.top = `${y}px`;
    }
  }

  #pin(vertex) {
    const dot = this.pins.get(vertex);
    if (dot) {
      this.#try(() => this.sinew.letGo(vertex));
      dot.remove();
      this.pins.delete(vertex);
    } else if (this.#try(() => this.sinew.hold(vertex))) {
      const made = Object.assign(document.createElement("div"), { className: "pin" });
      this.view.canvas.after(made);
      this.pins.set(vertex, made);
    }
    this.view.onChange();
  }

  #try(what) {
    try {
      what();
      return true;
    } catch (error) {
      this.hands.refused(error.message);
      return false;
    }
  }
}
