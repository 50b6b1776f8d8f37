/** Images of the encoders: RGBA bytes, with Pillow's bilinear filter on premultiplied colours. */

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
