/** onnxruntime's wasm in the page, a script of its own (`wasm.js`) that only pages of models have. */

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

Object.assign(window, { ddfWasm: { open } });
