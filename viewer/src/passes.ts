/**
 * What the passes of a network become: outputs of a field.
 *
 * Values alone are one pass. A normal takes the adjoint pass besides; mean curvature two tangents more, as in
 * `ddf.fields.curvature`: with slopes c = cos a and states h = sin a, bends are -h.
 */

import { OUTPUTS, widthOf, type Engine, type Output, type Values } from "./engine.ts";
import { depthOf, depthSlope, sigmoid, type Layer, type NetworkRecord } from "./network.ts";
import { breathe } from "./pacing.ts";

export const QUIET_MS = 30; // that a piece of work may keep the page waiting

export abstract class NetworkEngine implements Engine {
  abstract readonly name: string;
  readonly exact = false;
  readonly outputs: readonly Output[] = OUTPUTS;
  /** Rays that a chunk takes. */
  protected abstract readonly most: number;

  constructor(protected readonly record: NetworkRecord) {}

  /** Other weights of the same sizes. */
  abstract replace(layers: Layer[]): void;

  /** The rays of the next passes, by their positions and directions. */
  protected abstract take(positions: Float64Array, directions: Float64Array): void;

  /** Four numbers a ray, as are all passes': both raw depths, the logit of the first one's weight, that of visibility. */
  protected abstract forward(slopes: boolean, bend: boolean): Float32Array;

  /** ∇_p of the raw depth of a component (0: the heavier one), and one number more. */
  protected abstract adjoint(component: number, bend: boolean): Float32Array;

  /** Terms of Σ_l Σ_k g h (t² + t'²) over both tangents of the surface of the adjoint pass, to be summed. */
  protected abstract bending(): Float32Array;

  async evaluate(positions: Float64Array, directions: Float64Array, outputs: readonly Output[], signal?: AbortSignal): Promise<Values> {
    const count = positions.length / 3;
    const values: Values = Object.fromEntries(outputs.map((name) => [name, new Float32Array(count * widthOf(name))]));
    for (let from = 0, breath = performance.now(); from < count; ) {
      const until = Math.min(count, from + this.most);
      this.chunk(positions.subarray(3 * from, 3 * until), directions.subarray(3 * from, 3 * until), from, values);
      from = until;
      if (performance.now() - breath < QUIET_MS / 2 || from === count) continue;
      await breathe();
      signal?.throwIfAborted();
      breath = performance.now();
    }
    return values;
  }

  protected chunk(positions: Float64Array, directions: Float64Array, from: number, values: Values): void {
    const count = positions.length / 3;
    this.take(positions, directions);
    const bend = values.mean_curvature !== undefined;
    const found = this.forward(bend || values.normals !== undefined || values.normals_2 !== undefined, bend);
    const chosen = (i: number): number => (found[4 * i + 2]! >= 0 ? found[4 * i]! : found[4 * i + 1]!);
    for (let i = 0; i < count; i++) {
      if (values.visibility) values.visibility[from + i] = sigmoid(found[4 * i + 3]!);
      if (values.depth) values.depth[from + i] = depthOf(chosen(i), this.record);
      if (values.weight_1) values.weight_1[from + i] = sigmoid(found[4 * i + 2]!);
    }
    if (values.normals_2) facing(values.normals_2, this.adjoint(2, false), directions, from);
    if (!values.normals && !bend) return;
    const normals = values.normals ?? new Float32Array(3 * (from + count));
    facing(normals, this.adjoint(0, bend), directions, from);
    if (!values.mean_curvature) return;
    const sums = this.bending();
    for (let i = 0; i < count; i++) {
      const at = 3 * (from + i);
      const towards = normals[at]! * directions[3 * i]! + normals[at + 1]! * directions[3 * i + 1]! + normals[at + 2]! * directions[3 * i + 2]!;
      const form = -(sums[4 * i]! + sums[4 * i + 1]! + sums[4 * i + 2]! + sums[4 * i + 3]!);
      values.mean_curvature[from + i] = depthSlope(chosen(i), this.record) * towards * form;
    }
  }
}

/** Unit normals that face back, from gradients of rays; those of the first ray go to `from`. */
function facing(out: Float32Array, g: Float32Array, v: Float64Array, from: number): void {
  for (let i = 0, at = 3 * from; 3 * i < v.length; i++, at += 3) {
    const n = [g[4 * i]!, g[4 * i + 1]!, g[4 * i + 2]!];
    const long = Math.max(Math.hypot(n[0]!, n[1]!, n[2]!), 1e-12);
    const towards = n[0]! * v[3 * i]! + n[1]! * v[3 * i + 1]! + n[2]! * v[3 * i + 2]!;
    for (let axis = 0; axis < 3; axis++) out[at + axis] = ((towards > 0 ? -1 : 1) * n[axis]!) / long;
  }
}
