/**
 * A network on the GPU by WebGL2: matrix products as draws into float textures (`shaders.ts`), any width and depth.
 *
 * Values alone are one pass. A normal takes the adjoint pass besides; mean curvature two tangents more, as in
 * `ddf.fields.curvature`: with slopes c = cos a and states h = sin a, bends are -h.
 */

import type { Engine, Output, Values } from "./engine.ts";
import { depthOf, depthSlope, sigmoid, type Layer, type NetworkRecord } from "./network.ts";
import { WIDTH, type Gpu, type Inputs, type States } from "./gpu.ts";
import { breathe } from "./pacing.ts";
import * as shaders from "./shaders.ts";

const UNITS_IN_MEMORY = 64 * 128; // rows of rays times units of the widest layer
const FEWEST_ROWS = 4; // of rays in a chunk: below, draws cost more than rays
const PADDED = 256; // alignment of uniform blocks that every GPU takes, bytes
const QUIET_MS = 30; // that one draw of many rays may keep the page waiting

interface Weights {
  buffer: WebGLBuffer;
  bytes: number; // of a group
  groups: number;
}

const blocksOf = (units: number): number => Math.ceil(units / 4);

export class WebglEngine implements Engine {
  readonly name = "WebGL2";
  readonly exact = false;
  readonly outputs: readonly Output[] = ["visibility", "depth", "normals", "weight_1", "normals_2", "mean_curvature"];
  private readonly height: number;
  private readonly weights = new Map<string, Weights>();
  private readonly group: number; // blocks of units that a draw gives, half as many where each has two outputs
  private rows = FEWEST_ROWS; // of rays that a chunk takes

  constructor(
    private readonly gpu: Gpu,
    private readonly record: NetworkRecord,
    private layers: Layer[],
  ) {
    const { gl } = gpu;
    const widest = Math.max(...record.widths.slice(1));
    this.height = Math.max(1, Math.min(64, Math.floor(UNITS_IN_MEMORY / widest)));
    const fits = (group: number): boolean =>
      group * (64 * blocksOf(widest) + 16) <= gl.getParameter(gl.MAX_UNIFORM_BLOCK_SIZE) &&
      group <= gl.getParameter(gl.MAX_DRAW_BUFFERS);
    this.group = [8, 4, 2].find(fits) ?? 0;
    if (this.group === 0 || blocksOf(widest) + this.group > gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS)) {
      throw new Error(`layers of ${widest} units are wider than this GPU takes`);
    }
  }

  /** Other weights of the same sizes. */
  replace(layers: Layer[]): void {
    for (const { buffer } of this.weights.values()) this.gpu.gl.deleteBuffer(buffer);
    this.weights.clear();
    this.layers = layers;
  }

  async evaluate(
    positions: Float64Array,
    directions: Float64Array,
    outputs: readonly Output[],
    signal?: AbortSignal,
  ): Promise<Values> {
    const count = positions.length / 3;
    const values: Values = {};
    for (const name of outputs) values[name] = new Float32Array(count * (name.startsWith("normals") ? 3 : 1));
    for (let from = 0; from < count; ) {
      const until = Math.min(count, from + this.rows * WIDTH);
      const started = performance.now();
      this.chunk(positions, directions, from, until, values);
      const spent = performance.now() - started;
      if (spent < QUIET_MS / 2) this.rows = Math.min(this.height, 2 * this.rows);
      else if (spent > 2 * QUIET_MS) this.rows = Math.max(FEWEST_ROWS, this.rows >> 1);
      from = until;
      if (from < count) await breathe();
      signal?.throwIfAborted();
    }
    if (this.gpu.gl.isContextLost()) throw new Error("the GPU was taken away; load the page again");
    return values;
  }

  private chunk(positions: Float64Array, directions: Float64Array, from: number, until: number, values: Values): void {
    this.gpu.height = this.height;
    this.gpu.used = Math.ceil((until - from) / WIDTH);
    this.upload(positions, directions, from, until);
    const bend = values.mean_curvature !== undefined;
    const slopes = bend || values.normals !== undefined || values.normals_2 !== undefined;
    const raw = this.forward(slopes, bend);
    const found = this.gpu.read(raw);
    const chosen = (i: number): number => (found[4 * i + 2]! >= 0 ? found[4 * i]! : found[4 * i + 1]!);
    for (let i = 0; i < until - from; i++) {
      if (values.visibility) values.visibility[from + i] = sigmoid(found[4 * i + 3]!);
      if (values.depth) values.depth[from + i] = depthOf(chosen(i), this.record);
      if (values.weight_1) values.weight_1[from + i] = sigmoid(found[4 * i + 2]!);
    }
    if (values.normals_2) this.normals(values.normals_2, this.gpu.read(this.adjoint(2, false)), directions, from, until);
    if (!values.normals && !bend) return;
    const gradient = this.adjoint(0, bend);
    const gradients = this.gpu.read(gradient);
    const normals = values.normals ?? new Float32Array(3 * until);
    this.normals(normals, gradients, directions, from, until);
    if (!values.mean_curvature) return;
    const sums = this.gpu.read(this.bending(gradient));
    for (let i = 0; i < until - from; i++) {
      const at = 3 * (from + i);
      const towards = normals[at]! * directions[at]! + normals[at + 1]! * directions[at + 1]! + normals[at + 2]! * directions[at + 2]!;
      const form = -(sums[4 * i]! + sums[4 * i + 1]! + sums[4 * i + 2]! + sums[4 * i + 3]!);
      values.mean_curvature[from + i] = depthSlope(chosen(i), this.record) * towards * form;
    }
  }

  /** Rays as two blocks of inputs: (p, 0) and (v, 0). */
  private upload(positions: Float64Array, directions: Float64Array, from: number, until: number): void {
    const plane = 4 * WIDTH * this.gpu.used;
    const texels = new Float32Array(2 * plane);
    for (let i = from, at = 0; i < until; i++, at += 4) {
      texels.set(positions.subarray(3 * i, 3 * i + 3), at);
      texels.set(directions.subarray(3 * i, 3 * i + 3), plane + at);
    }
    this.gpu.upload(this.gpu.array("rays", 2), texels);
  }

  /** The value pass; keeps slopes of every layer where they are asked for, and the states where bends are. */
  private forward(slopes: boolean, bend: boolean): States {
    const hidden = this.layers.slice(0, -1);
    let source = this.gpu.array("rays", 2);
    hidden.forEach((layer, index) => {
      const target = this.layer(bend ? `h${index}` : `h${index % 2}`, layer.rows);
      const outs = slopes ? [target, this.layer(`c${index}`, layer.rows)] : [target];
      this.multiply(`W${index}`, source, outs, slopes ? "sine+slope" : "sine", false, {});
      source = target;
    });
    const raw = this.gpu.array("raw", 1);
    this.multiply("head", source, [raw], "linear", false, {});
    return raw;
  }

  /** ∇_p of the raw depth of a component (0: the heavier one); g h of every layer where bends are asked for. */
  private adjoint(component: number, bend: boolean): States {
    const last = this.layers.length - 2;
    const sizes = this.layers.map((layer) => layer.rows);
    const outs = (index: number): States[] => {
      const state = this.layer(`s${index % 2}`, sizes[index]!);
      return bend ? [state, this.layer(`b${index}`, sizes[index]!)] : [state];
    };
    const other = (index: number): Omit<Inputs, "source"> => ({
      slopes: this.layer(`c${index}`, sizes[index]!),
      values: bend ? this.layer(`h${index}`, sizes[index]!) : undefined,
    });
    this.start(outs(last), other(last), component, bend);
    for (let index = last; index > 0; index--) {
      const source = this.layer(`s${index % 2}`, sizes[index]!);
      this.multiply(`A${index}`, source, outs(index - 1), bend ? "adjoint+bend" : "adjoint", false, other(index - 1));
    }
    const gradient = this.gpu.array("gradient", 1);
    this.multiply("A0", this.layer("s0", sizes[0]!), [gradient], "linear", false, {});
    return gradient;
  }

  /** Σ_l Σ_k g h (t² + t'²) over both tangents of the surface. */
  private bending(gradient: States): States {
    const tangents = [this.gpu.array("t", 2), this.gpu.array("u", 2)];
    this.gpu.draw("basis", shaders.BASIS, { source: gradient }, tangents, 0, 1);
    let [sum, next] = [this.gpu.array("sum0", 1), this.gpu.array("sum1", 1)];
    this.gpu.clear(sum);
    for (const tangent of tangents) {
      let source = tangent;
      for (let index = 0; index + 1 < this.layers.length; index++) {
        const rows = this.layers[index]!.rows;
        const target = this.layer(`t${index % 2}`, rows);
        const slopes = index === 0 ? undefined : this.layer(`c${index - 1}`, this.layers[index - 1]!.rows);
        this.multiply(`T${index}`, source, [target], "linear", index > 0, { slopes });
        const inputs = { source: target, slopes: this.layer(`b${index}`, rows), values: sum };
        this.gpu.draw(`bending ${target.blocks}`, shaders.bending(target.blocks), inputs, [next], 0, 1);
        [sum, next] = [next, sum];
        source = target;
      }
    }
    return sum;
  }

  /** Unit normals that face back, from gradients of the chunk. */
  private normals(out: Float32Array, g: Float32Array, v: Float64Array, from: number, until: number): void {
    for (let i = 0, at = 3 * from; i < until - from; i++, at += 3) {
      const n = [g[4 * i]!, g[4 * i + 1]!, g[4 * i + 2]!];
      const long = Math.max(Math.hypot(n[0]!, n[1]!, n[2]!), 1e-12);
      const towards = n[0]! * v[at]! + n[1]! * v[at + 1]! + n[2]! * v[at + 2]!;
      for (let axis = 0; axis < 3; axis++) out[at + axis] = ((towards > 0 ? -1 : 1) * n[axis]!) / long;
    }
  }

  /** A product with the weights of that name: `W3` of a layer, `T3` without bias, `A3` transposed, `head`. */
  private multiply(
    name: string,
    source: States,
    outs: States[],
    epilogue: shaders.Epilogue,
    sloped: boolean,
    other: Omit<Inputs, "source">,
  ): void {
    const single = outs[0]!.blocks === 1;
    const blocks = single ? 1 : outs.length === 2 ? this.group / 2 : this.group;
    const weights = this.weightsOf(name, source.blocks, blocks);
    const shape: shaders.Product = { inputs: source.blocks, blocks, epilogue, sloped };
    const key = `product ${Object.values(shape)}`;
    for (let group = 0; group < weights.groups; group++) {
      this.gpu.bind(weights.buffer, group * weights.bytes, weights.bytes);
      this.gpu.draw(key, shaders.product(shape), { source, ...other }, outs, group * blocks, blocks);
    }
  }

  private start(outs: States[], other: Omit<Inputs, "source">, component: number, bend: boolean): void {
    const blocks = bend ? this.group / 2 : this.group;
    const weights = this.rowsOfHead(outs[0]!.blocks, blocks);
    const inputs = { source: this.gpu.array("raw", 1), ...other };
    for (let group = 0; group < weights.groups; group++) {
      this.gpu.bind(weights.buffer, group * weights.bytes, weights.bytes);
      this.gpu.draw(`start ${bend} ${blocks}`, shaders.start(blocks, bend), inputs, outs, group * blocks, blocks, component);
    }
  }

  /** Weights as uniform blocks, a group of output blocks each: mat4 w[blocks x inputs], vec4 bias[blocks]. */
  private weightsOf(name: string, inputs: number, blocks: number): Weights {
    const known = this.weights.get(`${name} ${blocks}`);
    if (known) return known;
    const { rows, weight, bias } = this.matrix(name);
    const groups = Math.ceil(blocksOf(rows) / blocks);
    const bytes = PADDED * Math.ceil((blocks * inputs * 64 + blocks * 16) / PADDED);
    const data = new Float32Array((groups * bytes) / 4);
    for (let row = 0; row < rows; row++) {
      const [block, lane] = [row >> 2, row & 3];
      const [base, inside] = [(Math.floor(block / blocks) * bytes) / 4, block % blocks];
      for (let column = 0; column < 4 * inputs; column++) {
        data[base + 16 * (inside * inputs + (column >> 2)) + 4 * (column & 3) + lane] = weight(row, column);
      }
      data[base + 16 * blocks * inputs + 4 * inside + lane] = bias(row);
    }
    return this.keep(`${name} ${blocks}`, data, bytes, groups);
  }

  /** A matrix by its name. Inputs of the first layer go in as (p, 0), (v, 0), see `upload`. */
  private matrix(name: string): { rows: number; weight(row: number, column: number): number; bias(row: number): number } {
    const index = name === "head" ? this.layers.length - 1 : Number(name.slice(1));
    const { weight, bias, rows, columns } = this.layers[index]!;
    const inside = (row: number, column: number): number => (row < rows && column < columns ? weight[row * columns + column]! : 0);
    if (name.startsWith("A")) {
      return { rows: index === 0 ? 3 : columns, weight: (row, column) => inside(column, row), bias: () => 0 };
    }
    const order = [0, 1, 2, columns, 3, 4, 5, columns];
    const of = index === 0 ? (row: number, column: number) => inside(row, order[column]!) : inside;
    return { rows, weight: of, bias: (row) => (name.startsWith("T") ? 0 : bias[row]!) };
  }

  /** The head's rows of both depths, as `shaders.start` reads them. */
  private rowsOfHead(padded: number, blocks: number): Weights {
    const known = this.weights.get(`rows ${blocks}`);
    if (known) return known;
    const { weight, columns } = this.layers[this.layers.length - 1]!;
    const bytes = PADDED * Math.ceil((2 * blocks * 16) / PADDED);
    const groups = padded / blocks;
    const data = new Float32Array((groups * bytes) / 4);
    for (let unit = 0; unit < columns; unit++) {
      const [group, inside] = [Math.floor(unit / 4 / blocks), unit % (4 * blocks)];
      for (const row of [0, 1]) data[(group * bytes) / 4 + 4 * blocks * row + inside] = weight[row * columns + unit]!;
    }
    return this.keep(`rows ${blocks}`, data, bytes, groups);
  }

  /** The states of a hidden layer, padded to whole groups. */
  private layer(name: string, units: number): States {
    return this.gpu.array(name, this.group * Math.ceil(blocksOf(units) / this.group));
  }

  private keep(name: string, data: Float32Array, bytes: number, groups: number): Weights {
    const buffer = this.gpu.buffer(data);
    const weights = { buffer, bytes, groups };
    this.weights.set(name, weights);
    return weights;
  }
}
