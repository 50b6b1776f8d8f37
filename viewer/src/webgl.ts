/**
 * A network on the GPU by WebGL2: matrix products as draws into float textures (`shaders.ts`), any width and depth, by the
 * passes of `passes.ts`.
 */

import * as shaders from "./shaders.ts";
import { type Layer, type NetworkRecord, NetworkEngine, QUIET_MS } from "./network.ts";
import type { Values } from "./engine.ts";
import { VERTEX } from "./shaders.ts";

export const WIDTH = 128; // rays side by side in a texture
const SLOTS = ["source", "slopes", "values"] as const;

export interface States {
  texture: WebGLTexture;
  blocks: number;
  id: number;
}

export type Inputs = Partial<Record<(typeof SLOTS)[number], States | undefined>>;

export class Gpu {
  private readonly programs = new Map<string, WebGLProgram>();
  private readonly targets = new Map<string, WebGLFramebuffer>();
  private readonly states = new Map<string, States>();
  height = 1; // rows of rays in the textures of the network at hand
  used = 1; // of those, in the chunk at hand

  private constructor(readonly gl: WebGL2RenderingContext) {
    gl.bindVertexArray(gl.createVertexArray());
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
  }

  /** Whether a CPU imitates it. */
  get isSoftware(): boolean {
    const names = this.gl.getExtension("WEBGL_debug_renderer_info");
    const renderer: string = names ? this.gl.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
    return /swiftshader|llvmpipe|software/i.test(renderer);
  }

  /** The GPU of the machine, or why it will not do. */
  static open(): Gpu | string {
    const canvas = document.createElement("canvas");
    const gl = canvas.getContext("webgl2", { antialias: false, depth: false, alpha: false });
    if (!gl) return "this browser has no WebGL2";
    if (!gl.getExtension("EXT_color_buffer_float")) return "this GPU does not draw into float textures";
    return new Gpu(gl);
  }

  /** One draw over all rays of the chunk: blocks `first` and on of every target. */
  draw(
    key: string,
    source: string,
    inputs: Inputs,
    outs: States[],
    first: number,
    blocks: number,
    component = 0,
  ): void {
    const { gl } = this;
    const program = this.program(key, source);
    gl.useProgram(program);
    SLOTS.forEach((slot, index) => {
      gl.activeTexture(gl.TEXTURE0 + index);
      gl.bindTexture(gl.TEXTURE_2D_ARRAY, inputs[slot]?.texture ?? null);
    });
    gl.uniform1i(gl.getUniformLocation(program, "first"), first);
    gl.uniform1i(gl.getUniformLocation(program, "component"), component);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer(outs, first, blocks));
    gl.viewport(0, 0, WIDTH, this.used);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  read(states: States): Float32Array {
    const { gl } = this;
    const values = new Float32Array(4 * WIDTH * this.used);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer([states], 0, 1));
    gl.readPixels(0, 0, WIDTH, this.used, gl.RGBA, gl.FLOAT, values);
    return values;
  }

  /** All zero. */
  clear(states: States): void {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, this.framebuffer([states], 0, 1));
    this.gl.clearBufferfv(this.gl.COLOR, 0, [0, 0, 0, 0]);
  }

  /** Texels of all blocks of the rows in use. */
  upload(states: States, texels: Float32Array): void {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, states.texture);
    gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, 0, WIDTH, this.used, states.blocks, gl.RGBA, gl.FLOAT, texels);
  }

  /** Weights of the next draw: a part of a buffer. */
  bind(buffer: WebGLBuffer, offset: number, bytes: number): void {
    this.gl.bindBufferRange(this.gl.UNIFORM_BUFFER, 0, buffer, offset, bytes);
  }

  buffer(data: Float32Array): WebGLBuffer {
    const buffer = this.gl.createBuffer();
    this.gl.bindBuffer(this.gl.UNIFORM_BUFFER, buffer);
    this.gl.bufferData(this.gl.UNIFORM_BUFFER, data, this.gl.STATIC_DRAW);
    return buffer;
  }

  private program(key: string, fragment: string): WebGLProgram {
    const known = this.programs.get(key);
    if (known) return known;
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(kind)!;
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      const shader = gl.getAttachedShaders(program)?.[1];
      throw new Error(`shader ${key}: ${gl.getProgramInfoLog(program)} ${shader ? gl.getShaderInfoLog(shader) : ""}`);
    }
    gl.useProgram(program);
    SLOTS.forEach((slot, index) => gl.uniform1i(gl.getUniformLocation(program, slot), index));
    const block = gl.getUniformBlockIndex(program, "Weights");
    if (block !== gl.INVALID_INDEX) gl.uniformBlockBinding(program, block, 0);
    this.programs.set(key, program);
    return program;
  }

  /** States of that name and size; the first to ask makes them. */
  array(name: string, blocks: number): States {
    const key = `${name} ${blocks} ${this.height}`;
    const known = this.states.get(key);
    if (known) return known;
    const { gl } = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, texture);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA32F, WIDTH, this.height, blocks);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    const states = { texture, blocks, id: this.states.size };
    this.states.set(key, states);
    return states;
  }

  private framebuffer(outs: States[], first: number, blocks: number): WebGLFramebuffer {
    const key = `${outs.map((states) => states.id)} ${first} ${blocks}`;
    const known = this.targets.get(key);
    if (known) return known;
    const { gl } = this;
    const framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    const attachments: number[] = [];
    for (const states of outs) {
      for (let block = first; block < first + blocks; block++) {
        const point = gl.COLOR_ATTACHMENT0 + attachments.length;
        gl.framebufferTextureLayer(gl.FRAMEBUFFER, point, states.texture, 0, block);
        attachments.push(point);
      }
    }
    gl.drawBuffers(attachments);
    this.targets.set(key, framebuffer);
    return framebuffer;
  }
}

const UNITS_IN_MEMORY = 64 * 128; // rows of rays times units of the widest layer
const FEWEST_ROWS = 4; // of rays in a chunk: below, draws cost more than rays
const PADDED = 256; // alignment of uniform blocks that every GPU takes, bytes

interface Weights {
  buffer: WebGLBuffer;
  bytes: number; // of a group
  groups: number;
}

const blocksOf = (units: number): number => Math.ceil(units / 4);

export class WebglEngine extends NetworkEngine {
  readonly name = "WebGL2";
  private readonly height: number;
  private readonly weights = new Map<string, Weights>();
  private readonly group: number; // blocks of units that a draw gives, half as many where each has two outputs
  private rows = FEWEST_ROWS; // of rays that a chunk takes

  constructor(
    private readonly gpu: Gpu,
    record: NetworkRecord,
    private readonly layers: Layer[],
  ) {
    super(record);
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

  protected get most(): number {
    return this.rows * WIDTH;
  }

  protected override chunk(positions: Float64Array, directions: Float64Array, from: number, values: Values): void {
    const started = performance.now();
    super.chunk(positions, directions, from, values);
    const spent = performance.now() - started;
    if (spent < QUIET_MS / 2) this.rows = Math.min(this.height, 2 * this.rows);
    else if (spent > 2 * QUIET_MS) this.rows = Math.max(FEWEST_ROWS, this.rows >> 1);
    if (this.gpu.gl.isContextLost()) throw new Error("the GPU was taken away; load the page again");
  }

  /** Rays as two blocks of inputs: (p, 0) and (v, 0). */
  protected take(positions: Float64Array, directions: Float64Array): void {
    const count = positions.length / 3;
    this.gpu.height = this.height;
    this.gpu.used = Math.ceil(count / WIDTH);
    const plane = 4 * WIDTH * this.gpu.used;
    const texels = new Float32Array(2 * plane);
    for (let i = 0, at = 0; i < count; i++, at += 4) {
      texels.set(positions.subarray(3 * i, 3 * i + 3), at);
      texels.set(directions.subarray(3 * i, 3 * i + 3), plane + at);
    }
    this.gpu.upload(this.gpu.array("rays", 2), texels);
  }

  /** The value pass; keeps slopes of every layer where they are asked for, and the states where bends are. */
  protected forward(slopes: boolean, bend: boolean): Float32Array {
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
    return this.gpu.read(raw);
  }

  /** ∇_p of the raw depth of a component (0: the heavier one); g h of every layer where bends are asked for. */
  protected adjoint(component: number, bend: boolean): Float32Array {
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
    return this.gpu.read(gradient);
  }

  /** Σ_l Σ_k g h (t² + t'²) over both tangents of the surface. */
  protected bending(): Float32Array {
    const tangents = [this.gpu.array("t", 2), this.gpu.array("u", 2)];
    this.gpu.draw("basis", shaders.BASIS, { source: this.gpu.array("gradient", 1) }, tangents, 0, 1);
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
    return this.gpu.read(sum);
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
