// The page: opens packages, builds the sliders from the component tree, and runs a frame whenever something moved.
// Address: `?package=FILE` opens another package than demo.sinew; `#c0=1.2&c0.1=-0.3` is a pose;
// `?package=FILE&check=POSES` plays the poses and puts the checksum of the frames into the title, for tests.
"use strict";

const element = (id) => document.getElementById(id);
const stage = element("stage");
const query = new URLSearchParams(location.search);

let module; // the compiled runtime
let sinew; // the open package, if any
let view; // none without WebGL
let rows = []; // by component: { component, weight, show() }
let animating = null; // time at which the animation started, in ms
let due = false;
let lastDrawn = 0;
const solved = new Mean(30);
const between = new Mean(30);

// A running mean of the last `size` numbers.
function Mean(size) {
  let values = [];
  this.add = (x) => void (values = [...values.slice(1 - size), x]);
  this.clear = () => void (values = []);
  this.value = () => values.reduce((sum, x) => sum + x, 0) / values.length;
}

function say(message) {
  element("message").textContent = message;
  element("message").hidden = message === "";
}

// Reads a file beside the page, or the copy that a single-file page carries.
async function read(name) {
  const inline = globalThis.SINEW_FILES?.[name];
  if (inline !== undefined) return Uint8Array.from(atob(inline), (c) => c.charCodeAt(0));
  const response = await fetch(name);
  if (!response.ok) throw new Error(`${name}: ${response.status} ${response.statusText}`);
  return new Uint8Array(await response.arrayBuffer());
}

// Opens a package; the one before stays when this one is refused.
async function openPackage(bytes, name) {
  const opened = await Sinew.load(module);
  try {
    opened.open(bytes);
  } catch (error) {
    say(`${name}: ${error.message}`);
    return;
  }
  say("");
  sinew = opened;
  element("welcome").hidden = true;
  element("title").replaceChildren();
  const heading = document.createElement("b");
  heading.textContent = name;
  const facts = document.createElement("span");
  facts.textContent = `${count(sinew.vertexCount, "vertex", "vertices")}, ${count(sinew.faceCount, "triangle", "triangles")}, `
    + count(sinew.components.length, "component", "components");
  element("title").append(heading, document.createElement("br"), facts);
  document.title = `${name} - Sinew`;
  view?.setMesh(sinew.faces, sinew.positions.slice());
  buildSliders();
  enable(true);
  animate(false);
  solved.clear();
  update();
}

const count = (n, one, many) => `${n.toLocaleString("en")} ${n === 1 ? one : many}`;

function enable(open) {
  for (const id of ["reset", "animate", "shuffle", "save"]) element(id).disabled = !open;
}

// One group a coarse component; under each component a fold with its children.
function buildSliders() {
  const children = new Map(sinew.components.map(({ index }) => [index, []]));
  const top = [];
  for (const component of sinew.components) (children.get(component.parent) ?? top).push(component);
  rows = [];
  // Many controls: show the coarse ones first.
  const folded = sinew.components.length > 24;

  const build = (component) => {
    const group = document.createElement("div");
    const below = children.get(component.index);
    const row = buildRow(component, below.length > 0);
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
  element("sliders").replaceChildren(...groups);
}

function buildRow(component, hasChildren) {
  const { index, name, parent, minimum, maximum } = component;
  const line = document.createElement("div");
  line.className = parent < 0 ? "row coarse" : "row";
  const fold = document.createElement(hasChildren ? "button" : "span");
  if (hasChildren) {
    fold.className = "fold";
    fold.title = "Finer components";
  }
  const label = document.createElement("label");
  label.className = "name";
  label.textContent = name;
  label.title = `${name}: from ${minimum.toFixed(2)} to ${maximum.toFixed(2)}; click for rest`;
  const track = document.createElement("span");
  track.className = "track";
  track.style.setProperty("--rest", maximum > minimum ? String(-minimum / (maximum - minimum)) : "0");
  const slider = Object.assign(document.createElement("input"), { type: "range", min: minimum, max: maximum, step: "any" });
  slider.setAttribute("aria-label", name);
  const number = Object.assign(document.createElement("input"), { type: "number", step: "0.01", min: minimum, max: maximum });
  number.setAttribute("aria-label", `${name}, weight`);
  track.append(slider);
  line.append(fold, label, track, number);

  const row = { component, line, fold, below: [], weight: 0 };
  row.show = () => {
    slider.value = String(row.weight);
    if (document.activeElement !== number) number.value = row.weight.toFixed(2);
    line.classList.toggle("moved", row.weight !== 0);
  };
  slider.oninput = () => moveByHand(index, slider.valueAsNumber);
  number.oninput = () => Number.isFinite(number.valueAsNumber) && moveByHand(index, number.valueAsNumber);
  number.onblur = row.show;
  label.onclick = () => moveByHand(index, 0);
  rows[index] = row;
  row.show();
  return row;
}

function move(index, weight) {
  const row = rows[index];
  row.weight = sinew.set(index, weight);
  row.show();
}

function moveByHand(index, weight) {
  animate(false);
  move(index, weight);
  update();
}

function moveAll(weight) {
  sinew.components.forEach((component) => move(component.index, weight(component)));
  update();
}

function animate(on) {
  animating = on ? performance.now() : null;
  element("animate").setAttribute("aria-pressed", String(on));
  if (on) update();
}

// Asks for a frame; many wishes between two pictures are one.
function update() {
  if (due) return;
  due = true;
  requestAnimationFrame(tick);
}

function tick(now) {
  due = false;
  if (sinew) {
    if (animating !== null) {
      const seconds = (now - animating) / 1000;
      for (const { index, minimum, maximum } of sinew.components) {
        // Coarse ones slowly, no two in step; from rest, half the way to either stop.
        const wave = Math.sin(seconds * (0.7 + 0.13 * (index % 7))) * Math.min(1, seconds);
        move(index, 0.5 * wave * (wave < 0 ? -minimum : maximum));
      }
    }
    const before = performance.now();
    let changed = true;
    try {
      changed = sinew.frame();
    } catch (error) {
      say(error.message);
    }
    if (changed) {
      solved.add(performance.now() - before);
      view?.setFrame(sinew.positions, sinew.normals);
      rememberPose();
    }
    for (const { line, below } of rows) {
      line.classList.toggle("hides-moved", below.some(({ index }) => rows[index].weight !== 0));
    }
  }
  view?.draw();
  showStats(now);
  if (animating !== null) update();
}

function showStats(now) {
  if (now - lastDrawn < 250) between.add(now - lastDrawn);
  else between.clear();
  lastDrawn = now;
  const pictures = between.value();
  const frame = solved.value();
  const lines = [
    Number.isNaN(pictures) ? "" : `${(1000 / pictures).toFixed(0)} fps`,
    Number.isNaN(frame) ? "" : `frame ${frame.toFixed(frame < 10 ? 2 : 1)} ms`,
  ];
  element("stats").textContent = lines.filter((line) => line !== "").join("\n");
}

// The pose in the address, once the hand rests.
let poseTimer;
function rememberPose() {
  clearTimeout(poseTimer);
  if (animating !== null) return;
  poseTimer = setTimeout(() => {
    const moved = rows.filter(({ weight }) => weight !== 0);
    const pose = moved.map(({ component, weight }) => `${encodeURIComponent(component.name)}=${weight.toFixed(4)}`);
    history.replaceState(null, "", `${location.pathname}${location.search}#${pose.join("&")}`);
  }, 300);
}

function poseFromAddress() {
  for (const [name, weight] of new URLSearchParams(location.hash.slice(1))) {
    const component = sinew.components.find((component) => component.name === name);
    if (component && Number.isFinite(Number(weight))) move(component.index, Number(weight));
  }
  update();
}

function saveObj() {
  const { positions, normals, faces } = sinew;
  const lines = [];
  const triples = (tag, values) => {
    for (let n = 0; n < values.length; n += 3) lines.push(`${tag} ${values[n]} ${values[n + 1]} ${values[n + 2]}`);
  };
  triples("v", positions);
  triples("vn", normals);
  for (let n = 0; n < faces.length; n += 3) {
    lines.push(`f ${[0, 1, 2].map((corner) => `${faces[n + corner] + 1}//${faces[n + corner] + 1}`).join(" ")}`);
  }
  const url = URL.createObjectURL(new Blob([`${lines.join("\n")}\n`], { type: "model/obj" }));
  Object.assign(document.createElement("a"), { href: url, download: "pose.obj" }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

async function openFile(file) {
  await openPackage(await file.arrayBuffer(), file.name);
}

function listen() {
  element("open").onclick = () => element("file").click();
  element("file").onchange = ({ target }) => {
    if (target.files[0]) openFile(target.files[0]);
    target.value = ""; // the same file again is a change
  };
  element("reset").onclick = () => {
    animate(false);
    moveAll(() => 0);
  };
  element("animate").onclick = () => animate(animating === null);
  element("shuffle").onclick = () => {
    animate(false);
    moveAll(({ minimum, maximum }) => 0.7 * (minimum + Math.random() * (maximum - minimum)));
  };
  element("save").onclick = saveObj;
  element("message").onclick = () => say("");
  for (const [id, option] of [["wire", "showWire"], ["heat", "showHeat"], ["z-up", "zUp"]]) {
    element(id).onchange = ({ target }) => {
      if (view) view[option] = target.checked;
      update();
    };
  }
  const keys = { r: "reset", " ": "animate", w: "wire", d: "heat" };
  addEventListener("keydown", (event) => {
    if (event.target.matches("input, button, summary") || event.ctrlKey || event.metaKey || event.altKey) return;
    const key = event.key.toLowerCase();
    if (key === "f") view?.frameMesh();
    else if (keys[key]) element(keys[key]).click();
    else return;
    event.preventDefault();
  });
  addEventListener("resize", update);
  addEventListener("hashchange", () => sinew && poseFromAddress());
  addEventListener("dragover", (event) => {
    event.preventDefault();
    stage.classList.add("dropping");
  });
  addEventListener("dragleave", (event) => event.relatedTarget === null && stage.classList.remove("dropping"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    stage.classList.remove("dropping");
    if (event.dataTransfer.files[0]) openFile(event.dataTransfer.files[0]);
  });
  const scheme = matchMedia("(prefers-color-scheme: dark)");
  const colour = () => {
    const wire = getComputedStyle(document.documentElement).getPropertyValue("--wire");
    if (view) view.lineColour = wire.trim().split(" ").map(Number);
    update();
  };
  scheme.addEventListener("change", colour);
  colour();
}

async function start() {
  enable(false);
  try {
    view = new MeshView(element("canvas"), update);
  } catch (error) {
    say(error.message);
  }
  listen();
  try {
    module = await WebAssembly.compile(await read("sinew.wasm"));
  } catch (error) {
    say(`The runtime could not be loaded (${error.message}). Serve this folder over HTTP, or open sinew.html.`);
    return;
  }
  const name = query.get("package") ?? "demo.sinew";
  try {
    await openPackage(await read(name), name.split("/").pop());
  } catch (error) {
    // A page without a demo beside it waits for a package; one that was asked for must be there.
    if (query.has("package")) say(error.message);
  }
  element("welcome").hidden = sinew !== undefined;
  if (!sinew) return;
  poseFromAddress();
  if (query.has("check")) {
    try {
      document.title = `checksum ${sinew.checksum(new TextDecoder().decode(await read(query.get("check"))))}`;
    } catch (error) {
      document.title = `failed: ${error.message}`;
    }
  }
}

start();
