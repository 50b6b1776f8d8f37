/** onnxruntime's wasm in the page, a script of its own (`wasm.js`) that only pages have which need it. */

import { widthOf, type Engine, type Output, type Values } from "./engine.ts";
import { breathe } from "./pacing.ts";
import * as ort from "onnxruntime-web/wasm";

/** A model that runs on this machine's CPU. */
export interface Model {
  run(inputs: Record<string, { data: Float32Array; shape: number[] }>, outputs: string[]): Promise<Record<string, Float32Array>>;
}

/** A model from its ONNX file; the first call starts the runtime. */
export async function open(runtime: ArrayBuffer, model: ArrayBuffer): Promise<Model> {
  ort.env.wasm.wasmBinary = runtime;
  ort.env.wasm.numThreads = 1; // more need a server that sends headers
  ort.env.logLevel = "error";
  const session = await ort.InferenceSession.create(model, { executionProviders: ["wasm"] });
  return {
    async run(inputs, outputs) {
      const tensors = Object.entries(inputs).map(([name, { data, shape }]) => [name, new ort.Tensor("float32", data, shape)]);
      const found = await session.run(Object.fromEntries(tensors), outputs);
      return Object.fromEntries(outputs.map((name) => [name, found[name]!.data as Float32Array]));
    },
  };
}

const CHUNK = 4096; // rays at a time

/** Graphs of a field, from the least to the most work; each gives what the ones before give too. */
const GRAPHS: [string, Output[]][] = [
  ["values", ["visibility", "depth", "weight_1"]],
  ["normals", ["visibility", "depth", "weight_1", "normals"]],
  ["mean_curvature", ["visibility", "depth", "weight_1", "normals", "mean_curvature"]],
];

/** A field on the CPU, where there is no WebGL2 or none but software. */
export class WasmEngine implements Engine {
  readonly name = "wasm";
  readonly exact = false;
  readonly outputs = GRAPHS[2]![1];
  private readonly models = new Map<string, Promise<Model>>();

  constructor(private readonly block: (id: string) => Promise<ArrayBuffer | null>) {}

  async evaluate(
    positions: Float64Array,
    directions: Float64Array,
    outputs: readonly Output[],
    signal?: AbortSignal,
  ): Promise<Values> {
    const known = outputs.filter((name) => this.outputs.includes(name));
    const [graph] = GRAPHS.find(([, gives]) => known.every((name) => gives.includes(name)))!;
    const model = await this.model(graph);
    const count = positions.length / 3;
    const values: Values = Object.fromEntries(known.map((name) => [name, new Float32Array(count * widthOf(name))]));
    for (let from = 0; from < count; from += CHUNK) {
      const until = Math.min(count, from + CHUNK);
      const rays = (all: Float64Array) => ({ data: Float32Array.from(all.subarray(3 * from, 3 * until)), shape: [until - from, 3] });
      const found = await model.run({ positions: rays(positions), directions: rays(directions) }, known);
      for (const name of known) values[name]!.set(found[name]!, from * widthOf(name));
      await breathe();
      signal?.throwIfAborted();
    }
    return values;
  }

  private model(graph: string): Promise<Model> {
    const known = this.models.get(graph) ?? this.load(graph);
    this.models.set(graph, known);
    return known;
  }

  private async load(graph: string): Promise<Model> {
    return open((await this.block("ddf-runtime"))!, (await this.block(`ddf-graph-${graph}`))!);
  }
}

Object.assign(window, { ddfWasm: { open, WasmEngine } });
