// Compiles against index.d.ts: what a user of the types writes.
import { Scene } from "three";
import { SinewLoader, SinewMesh, WorkerPlayer, open, type Control } from "sinew-three";

export async function show(scene: Scene): Promise<string[]> {
  const mesh: SinewMesh = await new SinewLoader().setWorker(true).setWasm("/sinew.wasm").loadAsync("walk.sinew");
  scene.add(mesh);
  const taken: number = mesh.setWeight("front-turn", 0.7);
  const other = new SinewMesh(await open(new ArrayBuffer(0)));
  const third = new SinewMesh(await WorkerPlayer.open(new Uint8Array(0)));
  // @ts-expect-error a weight is a number
  third.setWeight(0, "1");
  other.update();
  return mesh.controls.map((control: Control) => `${control.name} ${taken}`);
}
