/** Images of the encoders: RGBA bytes resized by Pillow's bilinear filter; an object placed as training images place theirs. */

export interface Pixels {
  data: ArrayLike<number>; // RGBA, 0 to 255
  width: number;
  height: number;
}

const UNIT = 2 ** 22; // what weights are whole multiples of, as Pillow's are

/** Weights of the triangle filter that makes `to` pixels of those from `start` to `end` of `count`, times `UNIT`: for every new pixel, the first old one and its weights. */
function filter(count: number, start: number, end: number, to: number): { first: number; weights: number[] }[] {
  const scale = (end - start) / to;
  const support = Math.max(scale, 1);
  return Array.from({ length: to }, (_, at) => {
    const centre = start + (at + 0.5) * scale;
    const first = Math.max(0, Math.floor(centre - support + 0.5));
    const last = Math.min(count, Math.floor(centre + support + 0.5));
    const weights = Array.from({ length: last - first }, (_, i) => Math.max(0, 1 - Math.abs((first + i + 0.5 - centre) / support)));
    const sum = weights.reduce((a, b) => a + b, 0);
    return { first, weights: weights.map((weight) => Math.floor((weight / sum) * UNIT + 0.5)) };
  });
}

/** A sum of bytes by such weights, as a byte. */
const rounded = (sum: number): number => Math.floor(sum / UNIT + 0.5);

/** A box of an image (left, top, right, bottom), resized to a square, as planes R, G, B, A in [0, 1]; colours are 0 where alpha is. Bytes are rounded where Pillow rounds them. */
export function resized(image: Pixels, box: readonly number[], size: number): Float32Array {
  const { width, height } = image;
  const kept = width === size && height === size && [0, 0, size, size].every((side, i) => side === box[i]); // no colour is rounded then
  const small = kept ? image.data : squeezed(image, box.map(Math.fround), size);
  const planes = new Float32Array(4 * size * size);
  for (let at = 0; at < size * size; at++) {
    const alpha = small[4 * at + 3]!;
    for (let c = 0; c < 3; c++) {
      const colour = small[4 * at + c]!;
      const own = kept || alpha === 0 ? colour : Math.min(255, Math.floor((255 * colour) / alpha));
      planes[c * size * size + at] = alpha > 0 ? own / 255 : 0;
    }
    planes[3 * size * size + at] = alpha / 255;
  }
  return planes;
}

/** Premultiplied bytes, resized along x and then along y. */
function squeezed({ data, width, height }: Pixels, box: number[], size: number): Uint8Array {
  const [left, top, right, bottom] = box as [number, number, number, number];
  const bytes = Uint8Array.from(data, (value, i) => (i % 4 === 3 ? value : Math.round((value * data[i | 3]!) / 255)));
  const rows = new Uint8Array(4 * height * size);
  filter(width, left, right, size).forEach(({ first, weights }, x) => {
    for (let y = 0; y < height; y++) {
      for (let c = 0; c < 4; c++) {
        const sum = weights.reduce((total, weight, i) => total + weight * bytes[4 * (y * width + first + i) + c]!, 0);
        rows[4 * (y * size + x) + c] = rounded(sum);
      }
    }
  });
  const found = new Uint8Array(4 * size * size);
  filter(height, top, bottom, size).forEach(({ first, weights }, y) => {
    for (let at = 0; at < 4 * size; at++) {
      found[4 * y * size + at] = rounded(weights.reduce((total, weight, i) => total + weight * rows[4 * (first + i) * size + at]!, 0));
    }
  });
  return found;
}

/** The pixels of an image file; throws one line that says what is wrong. */
export async function read(file: Blob): Promise<Pixels> {
  const bitmap = await createImageBitmap(file, { premultiplyAlpha: "none", colorSpaceConversion: "none" }).catch(() => {
    throw new Error("this is no image that the browser reads; give an RGBA PNG");
  });
  const found = { data: bytes(bitmap), width: bitmap.width, height: bitmap.height };
  let [least, most] = [255, 0];
  for (let at = 3; at < found.data.length; at += 4) [least, most] = [Math.min(least, found.data[at]!), Math.max(most, found.data[at]!)];
  if (most === 0) throw new Error("the image is transparent everywhere; its alpha must mask the object");
  if (least === 255) throw new Error("the image has no transparent pixel; cut the object out first, its alpha is the mask");
  return found;
}

/** As the file has them where there is WebGL2; a canvas multiplies colours by alpha, and what it gives back is rounded twice. */
function bytes(bitmap: ImageBitmap): ArrayLike<number> {
  const { width, height } = bitmap;
  const gl = new OffscreenCanvas(1, 1).getContext("webgl2");
  if (gl && Math.max(width, height) <= gl.getParameter(gl.MAX_TEXTURE_SIZE)) {
    const found = new Uint8Array(4 * width * height);
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
    gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, found);
    gl.getExtension("WEBGL_lose_context")?.loseContext();
    return found;
  }
  const pen = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true })!;
  pen.drawImage(bitmap, 0, 0);
  return pen.getImageData(0, 0, width, height).data;
}

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
