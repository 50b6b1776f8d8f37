/** What evaluates a network: a GPU by WebGL2 (`webgl.ts`), or a CPU by onnxruntime's wasm (`wasm.ts`). */

export type Output = "visibility" | "depth" | "normals" | "weight_1" | "normals_2" | "mean_curvature";
export const OUTPUTS: Output[] = ["visibility", "depth", "normals", "weight_1", "normals_2", "mean_curvature"];

export const widthOf = (output: Output): number => (output === "normals" || output === "normals_2" ? 3 : 1);

export type Values = Partial<Record<Output, Float32Array>>;

export interface Engine {
  name: string;
  outputs: readonly Output[];
  /** Named outputs inside the box, frame and unit of the field, for rays of 3 numbers each. Throws when aborted. */
  evaluate(
    positions: Float32Array,
    directions: Float32Array,
    outputs: readonly Output[],
    signal?: AbortSignal,
  ): Promise<Values>;
}
