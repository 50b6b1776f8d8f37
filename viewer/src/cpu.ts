/** A network on the CPU, by a kilobyte of wasm (`kernels/network.ts`) that every page has; the passes are those of `webgl.ts`. */

import { type Layer, type NetworkRecord, NetworkEngine } from "./network.ts";
import { tangents } from "./patches.ts";

declare const KERNELS: string; // base64, put in by `build.mjs`

/** Places are bytes from the start of the memory. */
interface Kernels {
  memory: WebAssembly.Memory;
  product(weights: number, biases: number, x: number, out: number, rows: number, columns: number): void;
  sines(at: number, cosines: number, units: number): void;
  times(a: number, b: number, out: number, units: number): void;
  bending(b: number, t: number, total: number, units: number): void;
}

interface Matrix {
  weights: number;
  biases: number;
  rows: number;
  columns: number;
}

const RAYS = 32; // of a tile
const [INPUTS, OUTS] = [6, 4];
const PAGE = 65536; // bytes that a memory grows by

/** The kernels, ready for `CpuEngine`. */
export const kernels = (): Promise<WebAssembly.Module> => WebAssembly.compile(Uint8Array.from(atob(KERNELS), (letter) => letter.charCodeAt(0)));

const padded = (units: number): number => 4 * Math.ceil(units / 4);

export class CpuEngine extends NetworkEngine {
  readonly name = "wasm";
  protected readonly most = RAYS;
  private readonly run: Kernels;
  private readonly memory: Float32Array;
  private used = 1024; // bytes of it
  private readonly layers: Matrix[]; // the head last
  private readonly adjoints: Matrix[]; // of the hidden layers, transposed
  private readonly states: Record<"sine" | "slope" | "bend", number[]>; // of each hidden layer
  private readonly spare: number[]; // places for states
  private readonly rays: number; // positions and directions; then tangents and zeros
  private readonly raw: number;
  private readonly total: number;
  private readonly zeros: number;

  constructor(module: WebAssembly.Module, record: NetworkRecord, layers: Layer[]) {
    super(record);
    this.run = new WebAssembly.Instance(module).exports as unknown as Kernels;
    const { widths } = record;
    const widest = padded(Math.max(...widths));
    const hidden = (): number[] => widths.slice(1, -1).map((units) => this.place(RAYS * padded(units)));
    this.zeros = this.place(widest);
    this.layers = layers.map(({ rows, columns }) => ({ weights: this.place(padded(rows) * columns), biases: this.place(padded(rows)), rows: padded(rows), columns }));
    this.adjoints = layers.map(({ rows, columns }) => ({ weights: this.place(padded(columns) * rows), biases: this.zeros, rows: padded(columns), columns: rows }));
    this.states = { sine: hidden(), slope: hidden(), bend: hidden() };
    this.spare = [0, 1, 2].map(() => this.place(RAYS * widest));
    this.rays = this.place(RAYS * INPUTS);
    this.raw = this.place(RAYS * OUTS);
    this.total = this.place(RAYS);
    this.memory = new Float32Array(this.run.memory.buffer);
    layers.forEach((layer, index) => this.hold(layer, this.layers[index]!, this.adjoints[index]!));
  }

  /** Where so many numbers may lie. */
  private place(numbers: number): number {
    const at = this.used;
    this.used += 4 * numbers;
    const { memory } = this.run;
    memory.grow(Math.max(0, Math.ceil((this.used - memory.buffer.byteLength) / PAGE)));
    return at;
  }

  /** Put a layer where its matrix and that transposed are to lie. */
  private hold({ weight, bias, rows, columns }: Layer, there: Matrix, back: Matrix): void {
    this.memory.set(bias, there.biases / 4);
    for (let row = 0; row < rows; row++) {
      for (let column = 0; column < columns; column++) {
        const value = weight[row * columns + column]!;
        this.memory[there.weights / 4 + ((row >> 2) * columns + column) * 4 + (row & 3)] = value;
        this.memory[back.weights / 4 + ((column >> 2) * rows + row) * 4 + (column & 3)] = value;
      }
    }
  }

  private product({ weights, biases, rows, columns }: Matrix, x: number, out: number): void {
    this.run.product(weights, biases, x, out, rows, columns);
  }

  protected take(positions: Float64Array, directions: Float64Array): void {
    for (let axis = 0, at = this.rays / 4; axis < INPUTS; axis++, at += RAYS) {
      const from = axis < 3 ? positions : directions;
      for (let ray = 0; 3 * ray < from.length; ray++) this.memory[at + ray] = from[3 * ray + (axis % 3)]!;
    }
  }

  protected forward(slopes: boolean): Float32Array {
    let x = this.rays;
    this.states.sine.forEach((out, index) => {
      this.product(this.layers[index]!, x, out);
      this.run.sines(out, slopes ? this.states.slope[index]! : 0, this.layers[index]!.rows);
      x = out;
    });
    this.product(this.layers.at(-1)!, x, this.raw);
    return this.told(this.raw);
  }

  protected adjoint(component: number, bend: boolean): Float32Array {
    const [g, s] = this.spare as [number, number];
    const { sine, slope, bend: bends } = this.states;
    const { weights, columns } = this.layers.at(-1)!;
    for (let ray = 0; ray < RAYS; ray++) {
      const first = component === 1 || (component === 0 && this.memory[this.raw / 4 + 2 * RAYS + ray]! >= 0);
      for (let unit = 0, row = weights / 4 + (first ? 0 : 1); unit < columns; unit++) this.memory[g / 4 + unit * RAYS + ray] = this.memory[row + OUTS * unit]!;
    }
    for (let index = sine.length - 1; index >= 0; index--) {
      const units = this.layers[index]!.rows;
      this.run.times(g, slope[index]!, s, units);
      if (bend) this.run.times(g, sine[index]!, bends[index]!, units);
      this.product(this.adjoints[index]!, s, g);
    }
    return this.told(g);
  }

  protected bending(): Float32Array {
    const [g, s, t] = this.spare as [number, number, number];
    const frame = new Float64Array(6);
    const ways = new Float32Array(2 * 3 * RAYS);
    for (let ray = 0; ray < RAYS; ray++) {
      const [x, y, z] = [0, 1, 2].map((axis) => this.memory[g / 4 + axis * RAYS + ray]!) as [number, number, number];
      const long = Math.max(Math.hypot(x, y, z), 1e-12);
      tangents(x / long, y / long, z / long, frame);
      for (let i = 0; i < 6; i++) ways[i * RAYS + ray] = frame[i]!;
    }
    this.memory.fill(0, this.total / 4, this.total / 4 + RAYS);
    this.memory.fill(0, this.rays / 4 + 3 * RAYS, this.rays / 4 + INPUTS * RAYS);
    for (let which = 0; which < 2; which++) {
      this.memory.set(ways.subarray(which * 3 * RAYS, (which + 1) * 3 * RAYS), this.rays / 4);
      let x = this.rays;
      this.states.bend.forEach((bend, index) => {
        const layer = this.layers[index]!;
        this.product({ ...layer, biases: this.zeros }, x, t);
        this.run.bending(bend, t, this.total, layer.rows);
        this.run.times(t, this.states.slope[index]!, s, layer.rows);
        x = s;
      });
    }
    return Float32Array.from({ length: OUTS * RAYS }, (_, i) => (i & 3 ? 0 : this.memory[this.total / 4 + (i >> 2)]!));
  }

  /** The first four units of states, four numbers a ray. */
  private told(at: number): Float32Array {
    const found = new Float32Array(OUTS * RAYS);
    for (let i = 0; i < found.length; i++) found[i] = this.memory[at / 4 + (i & 3) * RAYS + (i >> 2)]!;
    return found;
  }
}
