// The picture: a shaded mesh on a canvas through WebGL 2, orbited by mouse, pen, fingers or keys.
"use strict";

const VERTEX_SHADER = `#version 300 es
in vec3 position, normal, rest;
uniform mat4 clipFromModel;
uniform float farthest, wire;
out vec3 shadingNormal, modelPosition;
out float displacement;
void main() {
  shadingNormal = normal;
  modelPosition = position;
  displacement = clamp(distance(position, rest) / farthest, 0.0, 1.0);
  gl_Position = clipFromModel * vec4(position, 1.0);
  gl_Position.z -= 0.0008 * wire * gl_Position.w; // lines before their own faces
}`;

const FRAGMENT_SHADER = `#version 300 es
precision highp float;
in vec3 shadingNormal, modelPosition;
in float displacement;
uniform vec3 eye, right, up, clay, hot, line;
uniform float heat, wire;
out vec4 colour;
void main() {
  if (wire > 0.5) { colour = vec4(line, 1.0); return; }
  vec3 view = normalize(eye - modelPosition);
  vec3 n = normalize(shadingNormal);
  if (!gl_FrontFacing) n = -n;
  vec3 key = normalize(view + 0.7 * up - 0.6 * right);
  vec3 fill = normalize(view - 0.3 * up + 1.2 * right);
  float diffuse = 0.72 * max(dot(n, key), 0.0) + 0.22 * max(dot(n, fill), 0.0) + 0.20 + 0.08 * dot(n, up);
  float shine = pow(max(dot(n, normalize(key + view)), 0.0), 40.0);
  float edge = pow(1.0 - max(dot(n, view), 0.0), 3.0);
  vec3 base = mix(clay, hot, heat * sqrt(displacement));
  vec3 linear = base * diffuse + vec3(0.10 * shine + 0.12 * edge);
  colour = vec4(pow(linear, vec3(1.0 / 2.2)), 1.0);
}`;

// Linear light.
const CLAY = [0.5, 0.49, 0.47];
const HOT = [0.95, 0.16, 0.03];
// Distance from rest that is fully coloured, as a share of the mesh's radius.
const HOT_AT = 0.2;
const FIELD_OF_VIEW = (35 * Math.PI) / 180;
const PITCH_LIMIT = 1.55;

const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((x) => x / Math.hypot(...a));

class MeshView {
  // `onChange` is called when a new picture is due.
  constructor(canvas, onChange) {
    this.canvas = canvas;
    this.onChange = onChange;
    this.showWire = false;
    this.showHeat = false;
    this.zUp = false;
    this.lineColour = [0, 0, 0];
    this.indexCount = 0;
    this.grab = null; // takes presses on the mesh, if any
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true });
    if (!gl) throw new Error("This browser gives no WebGL 2, which the picture needs.");
    this.gl = gl;
    this.#compile();
    this.#listen();
    this.frameMesh([0, 0, 0], 1);
  }

  // A new mesh: `faces` u32 [F][3], `rest` f32 [V][3].
  setMesh(faces, rest) {
    const { gl } = this;
    gl.bindVertexArray(this.vertexArray);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.faceIndices);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    this.indexCount = faces.length;
    this.wireCount = 0;
    this.faces = faces;
    for (const name of ["rest", "position", "normal"]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[name]);
      gl.bufferData(gl.ARRAY_BUFFER, rest, name === "rest" ? gl.STATIC_DRAW : gl.DYNAMIC_DRAW);
    }
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (let n = 0; n < rest.length; n++) {
      low[n % 3] = Math.min(low[n % 3], rest[n]);
      high[n % 3] = Math.max(high[n % 3], rest[n]);
    }
    const centre = low.map((x, c) => 0.5 * (x + high[c]));
    this.frameMesh(centre, 0.5 * Math.hypot(...subtract(high, low)) || 1);
  }

  // The mesh of a frame: both f32 [V][3], one upload each.
  setFrame(positions, normals) {
    const { gl } = this;
    for (const [name, values] of [["position", positions], ["normal", normals]]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[name]);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, values);
    }
  }

  // Looks at the whole mesh from ahead and a little above.
  frameMesh(centre = this.centre, radius = this.radius) {
    Object.assign(this, { centre, radius, target: [...centre], yaw: 0.6, pitch: 0.3 });
    this.distance = (0.95 * radius) / Math.sin(0.5 * FIELD_OF_VIEW);
    this.onChange();
  }

  draw() {
    const { gl, canvas, uniform } = this;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((x) => Math.max(1, Math.round(x * ratio)));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (this.indexCount === 0) return;

    const camera = this.#camera();
    gl.useProgram(this.program);
    gl.bindVertexArray(this.vertexArray);
    gl.uniformMatrix4fv(uniform.clipFromModel, false, this.#clipFromModel(camera, width / height));
    gl.uniform3fv(uniform.eye, camera.eye);
    gl.uniform3fv(uniform.right, camera.right);
    gl.uniform3fv(uniform.up, camera.up);
    gl.uniform3fv(uniform.clay, CLAY);
    gl.uniform3fv(uniform.hot, HOT);
    gl.uniform3fv(uniform.line, this.lineColour);
    gl.uniform1f(uniform.farthest, HOT_AT * this.radius);
    gl.uniform1f(uniform.heat, this.showHeat ? 1 : 0);
    gl.uniform1f(uniform.wire, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.faceIndices);
    gl.drawElements(gl.TRIANGLES, this.indexCount, gl.UNSIGNED_INT, 0);
    if (this.showWire) {
      if (this.wireCount === 0) this.#makeWire();
      gl.uniform1f(uniform.wire, 1);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.wireIndices);
      gl.drawElements(gl.LINES, this.wireCount, gl.UNSIGNED_INT, 0);
    }
  }

  // The vertex seen under a point of the canvas and how far it is from the eye, or null: of those that are no further than `reach` CSS
  // pixels from it and whose normals look at the eye, the nearest to the eye, give or take the reach.
  vertexAt(positions, normals, x, y, reach) {
    const camera = this.#camera();
    const toScreen = this.#toScreen(camera);
    let found = null;
    for (let v = 0; v < positions.length / 3; v++) {
      const at = [positions[3 * v], positions[3 * v + 1], positions[3 * v + 2]];
      const [sx, sy, depth] = toScreen(at);
      const away = Math.hypot(sx - x, sy - y);
      if (depth <= 0 || away > reach) continue;
      const normal = [normals[3 * v], normals[3 * v + 1], normals[3 * v + 2]];
      if (dot(normal, subtract(camera.eye, at)) <= 0) continue;
      const cost = depth + away * this.#unitsPerPixel(depth);
      if (found === null || cost < found.cost) found = { vertex: v, depth, cost };
    }
    return found;
  }

  // The point of space under a point of the canvas, at a distance from the eye along the view.
  pointAt(x, y, depth) {
    const { eye, right, up, back } = this.#camera();
    const scale = this.#unitsPerPixel(depth);
    const [dx, dy] = [(x - 0.5 * this.canvas.clientWidth) * scale, (0.5 * this.canvas.clientHeight - y) * scale];
    return eye.map((e, c) => e + dx * right[c] + dy * up[c] - depth * back[c]);
  }

  // Where a vertex is on the canvas, in CSS pixels.
  screenOf(positions, vertex) {
    return this.#toScreen(this.#camera())(positions.slice(3 * vertex, 3 * vertex + 3));
  }

  #toScreen({ eye, right, up, back }) {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    return (point) => {
      const from = subtract(point, eye);
      const depth = -(from[0] * back[0] + from[1] * back[1] + from[2] * back[2]);
      const scale = this.#unitsPerPixel(depth);
      return [0.5 * width + dot(from, right) / scale, 0.5 * height - dot(from, up) / scale, depth];
    };
  }

  // A narrow window shows the whole width instead of the whole height.
  #unitsPerPixel(depth) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return (2 * depth * Math.tan(0.5 * FIELD_OF_VIEW)) / Math.max(1, Math.min(width, height));
  }

  #compile() {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, VERTEX_SHADER], [gl.FRAGMENT_SHADER, FRAGMENT_SHADER]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    this.program = program;
    const names = "clipFromModel eye right up clay hot line farthest heat wire".split(" ");
    this.uniform = Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(program, name)]));

    this.vertexArray = gl.createVertexArray();
    gl.bindVertexArray(this.vertexArray);
    this.buffers = {};
    for (const name of ["position", "normal", "rest"]) {
      this.buffers[name] = gl.createBuffer();
      const place = gl.getAttribLocation(program, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[name]);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
    }
    this.faceIndices = gl.createBuffer();
    this.wireIndices = gl.createBuffer();
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
  }

  // Every edge once.
  #makeWire() {
    const { gl, faces } = this;
    const seen = new Set();
    const lines = [];
    for (let n = 0; n < faces.length; n++) {
      const [a, b] = [faces[n], faces[n % 3 === 2 ? n - 2 : n + 1]];
      const key = Math.min(a, b) * 2 ** 26 + Math.max(a, b);
      if (!seen.has(key)) {
        seen.add(key);
        lines.push(a, b);
      }
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.wireIndices);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(lines), gl.STATIC_DRAW);
    this.wireCount = lines.length;
  }

  #camera() {
    const [cosine, sine] = [Math.cos(this.pitch), Math.sin(this.pitch)];
    let back = [cosine * Math.sin(this.yaw), sine, cosine * Math.cos(this.yaw)];
    let pole = [0, 1, 0];
    if (this.zUp) {
      back = [back[0], -back[2], back[1]];
      pole = [0, 0, 1];
    }
    const right = unit(cross(pole, back));
    const up = cross(back, right);
    const eye = this.target.map((x, c) => x + this.distance * back[c]);
    return { back, right, up, eye };
  }

  // Column-major.
  #clipFromModel({ back, right, up, eye }, aspect) {
    // A narrow window shows the whole width instead of the whole height.
    const scale = 1 / Math.tan(0.5 * FIELD_OF_VIEW);
    const [sx, sy] = aspect < 1 ? [scale, scale * aspect] : [scale / aspect, scale];
    // Room for a mesh that moves out of its rest sphere, and near planes far enough for a precise depth.
    const distance = Math.hypot(...subtract(eye, this.centre));
    const near = Math.max(distance - 3 * this.radius, 0.02 * this.radius);
    const far = distance + 4 * this.radius;
    const [a, b] = [(far + near) / (near - far), (2 * far * near) / (near - far)];
    const columns = [0, 1, 2].map((c) => [sx * right[c], sy * up[c], a * back[c], -back[c]]);
    const last = [-sx * dot(right, eye), -sy * dot(up, eye), -a * dot(back, eye) + b, dot(back, eye)];
    return [...columns.flat(), ...last];
  }

  #pan(dx, dy) {
    const { right, up } = this.#camera();
    const step = (2 * this.distance * Math.tan(0.5 * FIELD_OF_VIEW)) / this.canvas.clientHeight;
    this.target = this.target.map((x, c) => x + step * (dy * up[c] - dx * right[c]));
  }

  #turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.min(Math.max(this.pitch + pitch, -PITCH_LIMIT), PITCH_LIMIT);
  }

  #zoom(factor) {
    this.distance = Math.min(Math.max(this.distance * factor, 0.05 * this.radius), 40 * this.radius);
  }

  // What is not on the mesh: one finger or the main button turns; two fingers, another button or shift pan; pinch and wheel zoom.
  #listen() {
    const { canvas } = this;
    const held = new Map();
    const spread = () => {
      const [a, b] = [...held.values()];
      return Math.hypot(a.x - b.x, a.y - b.y);
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      if (held.size === 0 && this.grab?.press(event)) return;
      held.set(event.pointerId, { x: event.clientX, y: event.clientY });
    });
    canvas.addEventListener("pointermove", (event) => {
      if (this.grab?.drag(event)) return;
      const at = held.get(event.pointerId);
      if (!at) return;
      const [dx, dy] = [event.clientX - at.x, event.clientY - at.y];
      const before = held.size === 2 ? spread() : 0;
      Object.assign(at, { x: event.clientX, y: event.clientY });
      if (held.size === 2) {
        this.#pan(dx / 2, dy / 2);
        this.#zoom(before / Math.max(spread(), 1));
      } else if (event.shiftKey || event.buttons & ~1) {
        this.#pan(dx, dy);
      } else {
        this.#turn(-0.008 * dx, 0.008 * dy);
      }
      this.onChange();
    });
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => {
        held.delete(event.pointerId);
        this.grab?.release(event);
      });
    }
    const onWheel = (event) => {
      event.preventDefault();
      this.#zoom(Math.exp(0.0012 * event.deltaY));
      this.onChange();
    };
    canvas.addEventListener("wheel", onWheel, { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", () => this.frameMesh());
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
    canvas.addEventListener("keydown", (event) => {
      const [yaw, pitch] = turns[event.key] ?? [0, 0];
      if (yaw || pitch) this.#turn(yaw, pitch);
      else if (event.key === "+" || event.key === "-") this.#zoom(event.key === "+" ? 0.9 : 1.1);
      else return;
      event.preventDefault();
      this.onChange();
    });
  }
}
