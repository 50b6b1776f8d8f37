/** A sine network as the page holds it: y = W h_L + b, h_l = sin(W_l h_{l-1} + b_l), frequencies and modulations baked in. */

import { OUTPUTS, widthOf, type Engine, type Output, type Values, breathe } from "./engine.ts";

export interface Layer {
  weight: Float32Array; // rows x columns, row by row
  bias: Float32Array;
  rows: number;
  columns: number;
}

/** What Python's `viewer_page` says of a network; its numbers are `offset` and on in the block of weights. */
export interface NetworkRecord {
  kind: "sine";
  widths: number[]; // inputs, hidden, outputs
  offset: number;
  depth_activation: "relu" | "softplus";
  depth_sharpness: number;
}

/** Weights and biases, layer after layer, from the block. */
export function layersOf(record: NetworkRecord, numbers: Float32Array): Layer[] {
  const layers: Layer[] = [];
  let at = record.offset;
  for (let index = 1; index < record.widths.length; index++) {
    const [columns, rows] = [record.widths[index - 1]!, record.widths[index]!];
    const weight = numbers.subarray(at, at + rows * columns);
    const bias = numbers.subarray(at + rows * columns, at + rows * columns + rows);
    layers.push({ weight, bias, rows, columns });
    at += rows * columns + rows;
  }
  return layers;
}

/** d = φ(y), as `ddf.fields.siren`. */
export function depthOf(raw: number, record: NetworkRecord): number {
  const beta = record.depth_sharpness;
  if (record.depth_activation === "relu") return Math.max(raw, 0);
  return beta * raw > 20 ? raw : Math.log1p(Math.exp(beta * raw)) / beta;
}

/** φ'(y). */
export function depthSlope(raw: number, record: NetworkRecord): number {
  const beta = record.depth_sharpness;
  if (record.depth_activation === "relu") return raw > 0 ? 1 : 0;
  return 1 / (1 + Math.exp(-beta * raw));
}

export const sigmoid = (logit: number): number => 1 / (1 + Math.exp(-logit));

export const QUIET_MS = 30; // that a piece of work may keep the page waiting

export abstract class NetworkEngine implements Engine {
  abstract readonly name: string;
  readonly exact = false;
  readonly outputs: readonly Output[] = OUTPUTS;
  /** Rays that a chunk takes. */
  protected abstract readonly most: number;

  constructor(protected readonly record: NetworkRecord) {}

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
