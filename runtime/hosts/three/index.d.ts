import { BufferGeometry, Loader, Material, Mesh } from "three";

/** A component that a weight moves. */
export interface Control {
  readonly index: number;
  /** Unique in its package. */
  readonly name: string;
  /** Index of the control above it; -1 for a coarse one. */
  readonly parent: number;
  /** The least weight seen in training, at most 0. */
  readonly minimum: number;
  /** The greatest weight seen in training, at least 0. */
  readonly maximum: number;
}

/** What a `SinewMesh` plays: an opened package. */
export interface Player {
  readonly vertexCount: number;
  readonly faceCount: number;
  readonly components: readonly Control[];
  /** xyz for each vertex, in the source's order and units. */
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  /** Three vertices for each triangle, counter-clockwise from outside. */
  readonly faces: Uint32Array;
  /** Sets a weight, clamped to its range; returns what it took. Throws where it is not finite. */
  set(component: number, weight: number): number;
  /** All weights to 0. */
  reset(): void;
  /** True when `positions` and `normals` have changed. */
  frame(): boolean;
  close?(): void;
}

/** Plays on this thread. */
export class Sinew implements Player {
  static load(source: BufferSource | WebAssembly.Module): Promise<Sinew>;
  open(packageBytes: ArrayBuffer | Uint8Array): void;
  readonly vertexCount: number;
  readonly faceCount: number;
  readonly components: readonly Control[];
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  readonly faces: Uint32Array;
  set(component: number, weight: number): number;
  setShare(component: number, share: number): number;
  reset(): void;
  frame(): boolean;
}

/** Plays in a worker of its own. */
export class WorkerPlayer implements Player {
  static open(packageBytes: ArrayBuffer | Uint8Array, wasm?: string | URL): Promise<WorkerPlayer>;
  readonly vertexCount: number;
  readonly faceCount: number;
  readonly components: readonly Control[];
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  readonly faces: Uint32Array;
  set(component: number, weight: number): number;
  reset(): void;
  frame(): boolean;
  close(): void;
}

/** Opens a package on this thread. Rejects, with the reason, where the bytes are none. */
export function open(packageBytes: ArrayBuffer | Uint8Array, wasm?: string | URL): Promise<Sinew>;

/** A mesh that a package plays on. Call `update()` once a frame. */
export class SinewMesh extends Mesh<BufferGeometry, Material> {
  constructor(player: Player, material?: Material);
  readonly player: Player;
  readonly controls: readonly Control[];
  /** As last taken; to change one, `setWeight`. */
  readonly weights: Float32Array;
  indexOf(control: string | number): number;
  setWeight(control: string | number, weight: number): number;
  reset(): void;
  update(): boolean;
  dispose(): void;
}

/** Loads baked packages. */
export class SinewLoader extends Loader<SinewMesh> {
  setWasm(url: string | URL): this;
  setWorker(inWorker: boolean): this;
  parse(packageBytes: ArrayBuffer | Uint8Array): Promise<SinewMesh>;
}
