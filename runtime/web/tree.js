// The component tree: a slider for each component, with its weight as the thumb and, on a stage, its knob as a mark.
"use strict";

class Tree {
  // `move(index, weight)` is called when a hand moves a slider, `begin()` before the first of such moves.
  constructor(holder, move, begin) {
    Object.assign(this, { holder, move, begin });
    this.rows = [];
  }

  // One group a coarse component; under each component a fold with its children.
  build(components) {
    const children = new Map(components.map(({ index }) => [index, []]));
    const top = [];
    for (const component of components) (children.get(component.parent) ?? top).push(component);
    this.rows = [];
    // Many controls: show the coarse ones first.
    const folded = components.length > 24;
    const build = (component) => {
      const group = document.createElement("div");
      const below = children.get(component.index);
      const row = this.#row(component, below.length > 0);
      group.append(row.line);
      if (below.length > 0) {
        const list = document.createElement("div");
        list.className = "children";
        list.append(...below.map(build));
        group.append(list);
        const fold = (hide) => {
          list.hidden = hide;
          row.fold.setAttribute("aria-expanded", String(!hide));
        };
        row.fold.onclick = () => fold(!list.hidden);
        row.below = below;
        fold(folded);
      }
      return group;
    };
    const groups = top.map(build);
    groups.forEach((group) => group.classList.add("group"));
    this.holder.replaceChildren(...groups);
  }

  #row(component, hasChildren) {
    const { index, name, parent, minimum, maximum } = component;
    const line = document.createElement("div");
    line.className = parent < 0 ? "row coarse" : "row";
    const fold = document.createElement(hasChildren ? "button" : "span");
    if (hasChildren) {
      fold.className = "fold";
      fold.title = "Finer components";
      fold.setAttribute("aria-label", `Finer components of ${name}`);
    }
    const label = document.createElement("button");
    label.className = "name";
    label.textContent = name;
    label.title = `${name}: from ${minimum.toFixed(2)} to ${maximum.toFixed(2)}; click for rest`;
    const track = document.createElement("span");
    track.className = "track";
    const share = (weight) => (maximum > minimum ? Math.min(1, Math.max(0, (weight - minimum) / (maximum - minimum))) : 0);
    track.style.setProperty("--rest", String(share(0)));
    const slider = Object.assign(document.createElement("input"), { type: "range", min: minimum, max: maximum, step: "any" });
    slider.setAttribute("aria-label", name);
    const number = Object.assign(document.createElement("input"), { type: "number", step: "0.01", min: minimum, max: maximum });
    number.setAttribute("aria-label", `${name}, weight`);
    const way = Object.assign(document.createElement("span"), { className: "way", hidden: true });
    const mark = Object.assign(document.createElement("span"), { className: "knob", hidden: true });
    track.append(slider, way, mark);
    line.append(fold, label, track, number);

    const row = { component, line, fold, below: [], weight: 0, held: 0, assignment: null };
    const values = () => {
      const knob = row.assignment ? `, knob ${words(row.assignment)}` : "";
      slider.setAttribute("aria-valuetext", `${row.weight.toFixed(2)}${knob}`);
    };
    row.show = () => {
      // A slider in the hand stays where the hand has it.
      if (performance.now() - row.held > 250) slider.value = String(row.weight);
      if (document.activeElement !== number) number.value = row.weight.toFixed(2);
      line.classList.toggle("moved", row.weight !== 0);
      values();
    };
    // The knob's mark, and the way that it has to go before it moves the control.
    row.showKnob = (assignment) => {
      row.assignment = assignment;
      const isKnown = assignment !== null && Number.isFinite(assignment.weight);
      const isWaiting = isKnown && assignment.state.startsWith("turn");
      mark.hidden = !isKnown;
      way.hidden = !isWaiting;
      line.classList.toggle("engaged", assignment?.state === "engaged");
      if (isKnown) {
        const [at, goal] = [share(assignment.weight), share(row.weight)];
        mark.style.setProperty("--at", String(at));
        way.style.setProperty("--from", String(Math.min(at, goal)));
        way.style.setProperty("--length", String(Math.abs(goal - at)));
      }
      track.title = assignment ? `knob ${words(assignment)}` : "";
      values();
    };
    const byHand = (weight) => {
      row.held = performance.now();
      this.move(index, weight);
    };
    slider.onpointerdown = () => this.begin();
    slider.onkeydown = (event) => event.key.startsWith("Arrow") && !event.repeat && this.begin();
    slider.oninput = () => byHand(slider.valueAsNumber);
    slider.onchange = () => {
      row.held = 0;
    };
    number.onfocus = () => this.begin();
    number.oninput = () => Number.isFinite(number.valueAsNumber) && this.move(index, number.valueAsNumber);
    number.onblur = row.show;
    label.onclick = () => {
      this.begin();
      this.move(index, 0);
    };
    this.rows[index] = row;
    row.show();
    return row;
  }

  // Marks the folds that hide something that moved.
  markHidden() {
    for (const { line, below } of this.rows) {
      line.classList.toggle("hides-moved", below.some(({ index }) => this.rows[index].weight !== 0));
    }
  }

  // Where the knobs stand: one assignment a component at most, that which moves it before one that waits.
  showKnobs(assignments) {
    const own = new Map();
    for (const assignment of assignments) {
      if (!own.has(assignment.component) || assignment.state === "engaged") own.set(assignment.component, assignment);
    }
    for (const row of this.rows) {
      const assignment = own.get(row.component.index) ?? null;
      if (assignment !== null || row.assignment !== null) row.showKnob(assignment);
    }
  }
}

// What a knob does with its control, or has to do before it moves it.
function words({ state, distance }) {
  if (!state.startsWith("turn")) return state === "engaged" ? "moves it" : state;
  return `${state} ${Math.max(1, Math.round(100 * distance))} % to pick up`;
}
