/** The data that Python wrote into the page. */

import type { FieldRecord } from "./field.ts";
import type { Vector } from "./vectors.ts";

/** A model whose field is that of an image. */
export interface ModelRecord {
  image_size: number; // pixels a side that the encoders take
  samples: string[]; // addresses of images, their data inside
  radius: number; // mean of training cameras, benchmark units
  usual: boolean; // whether the encoders say how far an image is from the training images
}

/** Record `page` of the page, see Python's `viewer_page`. */
export interface PageRecord {
  title: string;
  about: string; // one sentence
  up: "y" | "z";
  azimuth: number; // of the first picture, degrees
  corners: Vector[]; // of the box that cameras are about, frame of the world
  fields: FieldRecord[];
  box: [Vector, Vector] | null; // of a scene: what lies before it is cut away
  model: ModelRecord | null;
}

export const readPage = (): PageRecord => JSON.parse(document.getElementById("ddf-page")!.textContent!) as PageRecord;

/** A block of the page, which is there as gzip in base64. */
export async function readBlock(id: string): Promise<ArrayBuffer | null> {
  const text = document.getElementById(id)?.textContent?.trim();
  if (!text) return null;
  const packed = await fetch(`data:application/octet-stream;base64,${text}`); // the browser's own base64
  return new Response(packed.body!.pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}
