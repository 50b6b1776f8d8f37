/** RGBA images as the encoders take them: `shapenet.read_any_image`, with Pillow's bilinear filter on premultiplied colours. */

export interface Pixels {
  data: ArrayLike<number>; // RGBA, 0 to 255
  width: number;
  height: number;
}

/** Weights of the triangle filter that shrinks or grows `from` pixels to `to`: for every new pixel, the first old one and its weights. */
function filter(from: number, to: number): { first: number; weights: number[] }[] {
  const scale = from / to;
  const support = Math.max(scale, 1);
  return Array.from({ length: to }, (_, at) => {
    const centre = (at + 0.5) * scale;
    const first = Math.max(0, Math.floor(centre - support + 0.5));
    const last = Math.min(from, Math.floor(centre + support + 0.5));
    const weights = Array.from({ length: last - first }, (_, i) => Math.max(0, 1 - Math.abs((first + i + 0.5 - centre) / support)));
    const sum = weights.reduce((a, b) => a + b, 0);
    return { first, weights: weights.map((weight) => weight / sum) };
  });
}

/** In the middle of a transparent square, resized, as planes R, G, B, A in [0, 1]; colours are 0 where alpha is. */
export function encoderInput(image: Pixels, size: number): Float32Array {
  const side = Math.max(image.width, image.height);
  const [left, top] = [Math.floor((side - image.width) / 2), Math.floor((side - image.height) / 2)];
  const taps = filter(side, size);
  const rows = new Float64Array(4 * side * size); // resized in x alone
  for (let y = 0; y < image.height; y++) {
    taps.forEach(({ first, weights }, x) => {
      const sums = [0, 0, 0, 0];
      weights.forEach((weight, i) => {
        const column = first + i - left;
        if (column < 0 || column >= image.width) return;
        const at = 4 * (y * image.width + column);
        const alpha = image.data[at + 3]!;
        for (let c = 0; c < 3; c++) sums[c]! += (weight * image.data[at + c]! * alpha) / 255;
        sums[3]! += weight * alpha;
      });
      for (let c = 0; c < 4; c++) rows[4 * ((y + top) * size + x) + c] = Math.round(sums[c]!);
    });
  }
  const planes = new Float32Array(4 * size * size);
  for (let x = 0; x < size; x++) {
    taps.forEach(({ first, weights }, y) => {
      const sums = [0, 0, 0, 0];
      weights.forEach((weight, i) => {
        for (let c = 0; c < 4; c++) sums[c]! += weight * rows[4 * ((first + i) * size + x) + c]!;
      });
      const alpha = Math.round(sums[3]!);
      for (let c = 0; c < 3; c++) {
        const colour = alpha > 0 ? Math.min(255, Math.floor((255 * Math.round(sums[c]!)) / alpha)) : 0;
        planes[(c * size + y) * size + x] = colour / 255;
      }
      planes[(3 * size + y) * size + x] = alpha / 255;
    });
  }
  return planes;
}

/** The pixels of an image file; throws one line that says what is wrong. */
export async function read(file: Blob): Promise<Pixels> {
  const bitmap = await createImageBitmap(file, { premultiplyAlpha: "none", colorSpaceConversion: "none" }).catch(() => {
    throw new Error("this is no image that the browser reads; give an RGBA PNG");
  });
  const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
  const pen = canvas.getContext("2d", { willReadFrequently: true })!;
  pen.drawImage(bitmap, 0, 0);
  const found = pen.getImageData(0, 0, bitmap.width, bitmap.height);
  let [least, most] = [255, 0];
  for (let at = 3; at < found.data.length; at += 4) [least, most] = [Math.min(least, found.data[at]!), Math.max(most, found.data[at]!)];
  if (most === 0) throw new Error("the image is transparent everywhere; its alpha must mask the object");
  if (least === 255) throw new Error("the image has no transparent pixel; cut the object out first, its alpha is the mask");
  return found;
}
