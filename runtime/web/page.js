// The page: opens packages, plays them here or on the stage that serves it, and runs a frame whenever something moved.
// Address: `?package=FILE` opens another package than demo.sinew; `?view=mesh` shows the mesh alone, `&background=transparent` or
// a colour behind it; `#c0=1.2&c0.1=-0.3` is a pose, where there is no stage.
"use strict";

const element = (id) => document.getElementById(id);
const query = new URLSearchParams(location.search);
const UNDO_MAX = 100;

let module; // the compiled runtime
let sinew; // the open package, if any
let view; // none without WebGL
let grab; // nor without a view
let animating = null; // time at which the animation started, in ms
let due = false;
let lastDrawn = 0;
let state = null; // what the stage last said
const undo = []; // poses
const solved = new Mean(30);
const between = new Mean(30);
const tree = new Tree(element("sliders"), moveByHand, beginByHand);
const link = new Link({ hello: onHello, frame: onFrame, state: onState, lost: onLost, refused: say });

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
  grab?.setMesh(sinew);
  undo.length = 0;
  element("undo").disabled = true;
  tree.build(sinew.components);
  enable(true);
  animate(false);
  solved.clear();
  update();
}

const count = (n, one, many) => `${n.toLocaleString("en")} ${n === 1 ? one : many}`;

function enable(open) {
  for (const id of ["reset", "animate", "shuffle", "save"]) element(id).disabled = !open;
}

// A weight as it is now, here and on its slider.
function show(index, weight) {
  const row = tree.rows[index];
  row.weight = sinew.set(index, weight);
  row.show();
}

// A weight as somebody here wants it: on a stage it is asked for, and comes back with the next frame.
function move(index, weight) {
  if (link.isOpen) link.set(index, weight);
  else show(index, weight);
}

// The pose before a hand moves it, for undo.
function beginByHand() {
  const pose = tree.rows.map(({ weight }) => weight);
  const last = undo.at(-1);
  if (last?.every((weight, index) => weight === pose[index])) return;
  undo.push(pose);
  if (undo.length > UNDO_MAX) undo.shift();
  element("undo").disabled = false;
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

// A hand on the mesh has moved the runtime's weights.
function moveByGrab() {
  animate(false);
  for (const row of tree.rows) {
    const weight = sinew.weight(row.component.index);
    if (weight !== row.weight) {
      move(row.component.index, weight);
      row.weight = weight;
      row.show();
    }
  }
  update();
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
    tree.markHidden();
  }
  grab?.place();
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
    state && link.isOpen ? `stage ${state.fps} fps, ${count(state.screens, "screen", "screens")}` : "",
  ];
  element("stats").textContent = lines.filter((line) => line !== "").join("\n");
}

// The pose in the address, once the hand rests; a stage has its own.
let poseTimer;
function rememberPose() {
  clearTimeout(poseTimer);
  if (animating !== null || link.isOpen) return;
  poseTimer = setTimeout(() => {
    const moved = tree.rows.filter(({ weight }) => weight !== 0);
    const pose = moved.map(({ component, weight }) => `${encodeURIComponent(component.name)}=${weight.toFixed(4)}`);
    history.replaceState(null, "", `${location.pathname}${location.search}#${pose.join("&")}`);
  }, 300);
}

function poseFromAddress() {
  const named = new Map(new URLSearchParams(location.hash.slice(1)));
  if (named.size === 0) return;
  const weights = sinew.components.map(({ name }) => Number(named.get(name) ?? 0));
  moveAll(({ index }) => (Number.isFinite(weights[index]) ? weights[index] : 0));
}

// A stage: its package, its transport, its knobs.
async function onHello(hello) {
  element("transport").hidden = element("show").hidden = false;
  element("open").hidden = true;
  document.body.classList.toggle("replay", hello.replay);
  for (const id of ["stop", "record", "previous", "next", "into", "out", "next-fine"]) element(id).disabled = hello.replay;
  for (const id of ["into", "out", "next-fine"]) element(id).hidden = !hello.tree;
  for (const id of ["previous", "next"]) element(id).hidden = !hello.tree && hello.pages < 2;
  element("knobs").replaceChildren(...hello.knobs.map((name) => {
    const item = document.createElement("li");
    const meter = Object.assign(document.createElement("meter"), { min: 0, max: 1 });
    meter.setAttribute("aria-label", name);
    item.append(name, meter);
    return item;
  }));
  const token = query.get("token");
  try {
    await openPackage(await read(token ? `package.sinew?token=${encodeURIComponent(token)}` : "package.sinew"), hello.title.split(": ")[0]);
    if (hello.replay) say("A take is replayed: it is seen here, and not moved.");
  } catch (error) {
    say(error.message);
  }
}

function onFrame({ weights, knobs, assignments }) {
  if (weights.length !== tree.rows.length) return; // of a package that is still on its way
  weights.forEach((weight, index) => {
    // A vertex in the hand is ahead of the stage.
    if (tree.rows[index].weight !== weight && !grab?.held) show(index, weight);
  });
  tree.showKnobs(assignments);
  const items = element("knobs").children;
  knobs.forEach((position, knob) => {
    const item = items[knob];
    if (!item) return;
    const own = assignments.find((assignment) => assignment.knob === knob);
    item.lastChild.value = Number.isNaN(position) ? 0 : position;
    item.className = own?.state === "engaged" ? "engaged" : own?.state.startsWith("turn") ? "waiting" : "";
    item.title = own ? `${tree.rows[own.component].component.name}: ${words(own)}` : "moves nothing here";
  });
  update();
}

function onState(message) {
  state = message;
  element("device").textContent = message.device ?? "no device";
  element("knobs").hidden = message.device === null;
  element("where").textContent = message.where;
  const warnings = element("warnings");
  if (warnings.dataset.shown !== message.warnings.join("\n")) {
    warnings.dataset.shown = message.warnings.join("\n");
    warnings.replaceChildren(...message.warnings.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
  }
  element("stop").setAttribute("aria-pressed", String(message.stopped));
  element("stop").textContent = message.stopped ? "Release" : "Stop";
  element("record").setAttribute("aria-pressed", String(message.recording !== null));
  element("record").title = message.recording ? `Recording ${message.recording}; click to end (T)` : "Begin to record a take (T)";
  update();
}

function onLost() {
  element("warnings").dataset.shown = "";
  element("device").textContent = "The stage is gone; this page goes on by itself and looks for it.";
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

function listenToButtons() {
  element("open").onclick = () => element("file").click();
  element("file").onchange = ({ target }) => {
    if (target.files[0]) openFile(target.files[0]);
    target.value = ""; // the same file again is a change
  };
  element("reset").onclick = () => {
    animate(false);
    beginByHand();
    if (link.isOpen) link.ask({ ask: "rest" });
    else moveAll(() => 0);
  };
  element("undo").onclick = () => {
    animate(false);
    const pose = undo.pop();
    element("undo").disabled = undo.length === 0;
    if (pose) moveAll(({ index }) => pose[index]);
  };
  element("animate").onclick = () => {
    if (animating === null) beginByHand();
    animate(animating === null);
  };
  element("shuffle").onclick = () => {
    animate(false);
    beginByHand();
    moveAll(({ minimum, maximum }) => 0.7 * (minimum + Math.random() * (maximum - minimum)));
  };
  element("save").onclick = saveObj;
  element("message").onclick = () => say("");
  element("stop").onclick = () => link.ask({ ask: "stop-or-release" });
  element("record").onclick = () => link.ask({ ask: "record" });
  for (const name of ["previous", "next", "into", "out", "next-fine"]) {
    element(name).onclick = () => link.ask({ ask: "command", name });
  }
  for (const [id, option] of [["wire", "showWire"], ["heat", "showHeat"], ["z-up", "zUp"]]) {
    element(id).onchange = ({ target }) => {
      if (view) view[option] = target.checked;
      update();
    };
  }
}

function listenToKeys() {
  const here = { r: "reset", a: "animate", w: "wire", d: "heat" };
  const onStage = { " ": "stop", t: "record", ",": "previous", ".": "next", i: "into", o: "out", n: "next-fine" };
  addEventListener("keydown", (event) => {
    const key = event.key.toLowerCase();
    const isInField = event.target.matches("input[type=number]");
    if ((event.ctrlKey || event.metaKey) && key === "z" && !isInField) {
      element("undo").click();
      event.preventDefault();
      return;
    }
    if (isInField || event.ctrlKey || event.metaKey || event.altKey) return;
    // The space bar presses the button that has the focus.
    if (key === " " && event.target.matches("button, summary, input")) return;
    const id = here[key] ?? (link.isOpen ? onStage[key] : undefined);
    if (key === "f") view?.frameMesh();
    else if (key === "escape") grab?.letGo();
    else if (id && !element(id).hidden) element(id).click();
    else return;
    event.preventDefault();
  });
}

function listen() {
  listenToButtons();
  listenToKeys();
  addEventListener("resize", update);
  addEventListener("hashchange", () => sinew && !link.isOpen && poseFromAddress());
  const stage = element("stage");
  addEventListener("dragover", (event) => {
    event.preventDefault();
    stage.classList.toggle("dropping", !link.isOpen);
  });
  addEventListener("dragleave", (event) => event.relatedTarget === null && stage.classList.remove("dropping"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    stage.classList.remove("dropping");
    if (event.dataTransfer.files[0] && !link.isOpen) openFile(event.dataTransfer.files[0]);
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

// What the address says about the look.
function dress() {
  if (query.get("view") === "mesh") document.body.classList.add("mesh-only");
  const ground = query.get("background");
  if (ground !== null && CSS.supports("color", ground)) {
    document.documentElement.style.background = "none";
    element("stage").style.setProperty("--ground", ground);
    element("stage").style.background = ground;
  }
}

async function start() {
  enable(false);
  dress();
  try {
    view = new MeshView(element("canvas"), update);
    grab = new Grab(view, { begin: beginByHand, moved: moveByGrab, refused: say });
    view.grab = grab;
  } catch (error) {
    say(error.message);
  }
  listen();
  try {
    module = await WebAssembly.compile(await read(Sinew.fileName()));
  } catch (error) {
    say(`The runtime could not be loaded (${error.message}). Serve this folder over HTTP, or open sinew.html.`);
    return;
  }
  // A page that a stage serves plays what the stage plays.
  const mayHaveStage = location.protocol.startsWith("http") && !query.has("package") && !globalThis.SINEW_FILES;
  if (mayHaveStage && (await link.connect())) return;
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
}

start();
