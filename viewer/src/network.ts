/** A sine network as the page holds it: y = W h_L + b, h_l = sin(W_l h_{l-1} + b_l), frequencies and modulations baked in. */

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
