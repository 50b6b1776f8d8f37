/** What evaluates a field: of networks a GPU (`webgl.ts`) or the CPU (`cpu.ts`), of patches `patches.ts`. */

export type Output = "visibility" | "depth" | "normals" | "weight_1" | "normals_2" | "mean_curvature";
export const OUTPUTS: Output[] = ["visibility", "depth", "normals", "weight_1", "normals_2", "mean_curvature"];

export const widthOf = (output: Output): number => (output === "normals" || output === "normals_2" ? 3 : 1);

export type Values = Partial<Record<Output, Float32Array>>;

export interface Engine {
  name: string;
  outputs: readonly Output[];
  exact: boolean; // every hit is sure, normals cost nothing, and rays from outside the box are taken as they are
  /** Named outputs from inside the box, frame and unit of the field, for rays of 3 numbers each. Throws when aborted. */
  evaluate(
    positions: Float64Array,
    directions: Float64Array,
    outputs: readonly Output[],
    signal?: AbortSignal,
  ): Promise<Values>;
}

const channel = new MessageChannel();
const waiting: (() => void)[] = [];
channel.port1.onmessage = () => waiting.shift()?.();

/** Let the browser handle what has come in; timers would make it wait 4 ms. */
export const breathe = (): Promise<void> =>
  new Promise((resolve) => {
    waiting.push(resolve);
    channel.port2.postMessage(null);
  });
