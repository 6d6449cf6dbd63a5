// Plays a file in three.js and measures every vertex of every frame against the runtime's positions (frames x vertices x 3, f32):
// the distances must be those that the file itself names. node play.mjs FILE.glb POSITIONS.npy
import { readFileSync } from "node:fs";

globalThis.self = globalThis;
globalThis.ProgressEvent ??= class {};
const { AnimationMixer, Box3, LoopOnce, Vector3 } = await import("three");
const { GLTFLoader } = await import("three/addons/loaders/GLTFLoader.js");

const [file, array] = process.argv.slice(2);
const whole = (bytes) => bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
const gltf = await new Promise((done, fail) => new GLTFLoader().parse(whole(readFileSync(file)), "", done, fail));
let mesh;
let facts;
gltf.scene.traverse((node) => {
  if (node.isMesh) mesh = node;
  facts ??= node.userData.sinew;
});

const bytes = readFileSync(array);
const start = 10 + bytes.readUInt16LE(8);
const header = bytes.toString("latin1", 10, start);
const [frames, vertices] = header.match(/\(([^)]*)\)/)[1].split(",").map(Number);
const exact = new Float32Array(whole(bytes.subarray(start)));

const mixer = new AnimationMixer(gltf.scene);
const action = mixer.clipAction(gltf.animations[0]);
action.setLoop(LoopOnce).clampWhenFinished = true;
action.play();
const diagonal = new Box3().setFromBufferAttribute(mesh.geometry.attributes.position).getSize(new Vector3()).length();
const at = new Vector3();
let [squares, most] = [0, 0];
for (let frame = 0; frame < frames; frame++) {
  mixer.setTime(frame / 24);
  gltf.scene.updateMatrixWorld(true);
  for (let vertex = 0; vertex < vertices; vertex++) {
    mesh.getVertexPosition(vertex, at);
    const place = 3 * (frame * vertices + vertex);
    const far = Math.hypot(at.x - exact[place], at.y - exact[place + 1], at.z - exact[place + 2]) / diagonal;
    squares += far * far;
    most = Math.max(most, far);
  }
}
const rms = Math.sqrt(squares / (frames * vertices));
const percent = (share) => `${(100 * share).toFixed(4)} %`;
const [said] = facts.clips;
console.log(`three.js: ${frames} frames, rms ${percent(rms)}, most ${percent(most)}; the file says ${percent(said.rms)}, ${percent(said.max)}`);
process.exit(Math.abs(rms - said.rms) < 1e-5 && Math.abs(most - said.max) < 1e-4 ? 0 : 1);
