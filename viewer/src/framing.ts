/** An object placed in its picture as training images place theirs: `ddf.reconstruction.framing`. */

import { resized, type Pixels } from "./images.ts";

export type Frame = readonly [diagonal: number, right: number, down: number]; // of the object's box; its centre; picture sides

const START: Frame = [0.7, 0, 0.03];
const [COARSE, FINE, EACH_WAY] = [0.03, 0.01, 2]; // steps of the grids of places
const [LEAST, MOST]: Frame[] = [[0.3, -0.2, -0.2], [1.2, 0.2, 0.2]];
const OPAQUE = 128;

const clipped = (frame: Frame): Frame => frame.map((value, i) => Math.min(MOST![i]!, Math.max(LEAST![i]!, value))) as unknown as Frame;

/** The pixels of an object's box, and its frame where it stands as in training images. */
export class Cutout {
  readonly given: Frame | null;
  private readonly own: Pixels;
  private readonly diagonal: number;
  private readonly centre: [number, number];

  constructor({ data, width, height }: Pixels) {
    let [left, top, right, bottom] = [width, height, 0, 0];
    for (let y = 0; y < height; y++) {
      for (let x = 0; x < width; x++) {
        if (data[4 * (y * width + x) + 3]! < OPAQUE) continue;
        [left, top, right, bottom] = [Math.min(left, x), Math.min(top, y), Math.max(right, x + 1), Math.max(bottom, y + 1)];
      }
    }
    if (right === 0) throw new Error("the image has no opaque pixel; its alpha must mask the object");
    this.diagonal = Math.sqrt((right - left) ** 2 + (bottom - top) ** 2);
    const given: Frame = [this.diagonal / width, (left + right) / 2 / width - 0.5, (top + bottom) / 2 / height - 0.5];
    const free = width === height && left > 0 && top > 0 && right < width && bottom < height;
    this.given = free && clipped(given).every((value, i) => value === given[i]) ? given : null;
    const [x, y] = [Math.max(left - 1, 0), Math.max(top - 1, 0)]; // half transparent edges
    this.own = pasted({ data, width, height }, -x, -y, Math.min(right + 1, width) - x, Math.min(bottom + 1, height) - y);
    this.centre = [(left + right) / 2 - x, (top + bottom) / 2 - y];
  }

  /** The object as it stands in a frame, as the encoders take it. */
  crop(frame: Frame, size: number): Float32Array {
    const side = this.diagonal / frame[0];
    const [left, top] = [0, 1].map((i) => this.centre[i]! - side * (0.5 + frame[i + 1]!)) as [number, number];
    const [x, y] = [left, top].map((value) => Math.floor(Math.min(value, 0))) as [number, number];
    const width = Math.ceil(Math.max(left + side, this.own.width)) - x;
    const height = Math.ceil(Math.max(top + side, this.own.height)) - y;
    return resized(pasted(this.own, -x, -y, width, height), [left - x, top - y, left - x + side, top - y + side], size);
  }
}

/** A picture on a transparent canvas, from a place on. */
function pasted({ data, width, height }: Pixels, left: number, top: number, wide: number, high: number): Pixels {
  const found = new Uint8Array(4 * wide * high);
  for (let y = Math.max(0, -top); y < Math.min(height, high - top); y++) {
    for (let x = Math.max(0, -left); x < Math.min(width, wide - left); x++) {
      for (let c = 0; c < 4; c++) found[4 * ((y + top) * wide + x + left) + c] = data[4 * (y * width + x) + c]!;
    }
  }
  return { data: found, width: wide, height: high };
}

/** What the model says of crops. */
export interface Said {
  distances: ((crops: Float32Array[]) => Promise<Float32Array>) | null; // from the training images
  shape: (crop: Float32Array) => Promise<Frame>; // the frame of the shape that it sees, from the mean distance
}

/** Where the object stands in a picture as the model's training images are. */
export async function framed({ distances, shape }: Said, cutout: Cutout, size: number): Promise<Frame> {
  if (cutout.given) return cutout.given;
  if (!distances) return clipped(await shape(cutout.crop(START, size)));
  const usual = async (around: Frame, step: number): Promise<Frame> => {
    const frames = Array.from({ length: (2 * EACH_WAY + 1) ** 2 }, (_, i): Frame => {
      const [x, y] = [Math.floor(i / (2 * EACH_WAY + 1)) - EACH_WAY, (i % (2 * EACH_WAY + 1)) - EACH_WAY];
      return [around[0], around[1] + step * x, around[2] + step * y];
    });
    const found = await distances(frames.map((frame) => cutout.crop(frame, size)));
    const least = Math.min(...found);
    const weights = Array.from(found, (d) => Math.exp((least * least - d * d) / 2));
    const sum = weights.reduce((a, b) => a + b, 0);
    return [0, 1, 2].map((axis) => frames.reduce((total, frame, i) => total + frame[axis]! * weights[i]!, 0) / sum) as unknown as Frame;
  };
  const seen = await shape(cutout.crop(await usual(START, COARSE), size));
  const sized: Frame = [clipped(seen)[0], START[1], START[2]];
  return usual(await usual(sized, COARSE), FINE);
}
