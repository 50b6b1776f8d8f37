/** From an image to a live field, all inside the page: encoders by wasm, modulations baked into the field's weights. */

import { readBlock, type ModelRecord } from "./blocks.ts";
import { hits, spread, type Cloud } from "./cloud.ts";
import { encoderInput, read } from "./images.ts";
import type { Layer } from "./network.ts";
import { element } from "./panel.ts";
import type { View } from "./view.ts";
import type { Model } from "./wasm.ts";
import type { WebglEngine } from "./webgl.ts";
import { centre, type Camera } from "./camera.ts";

const BENCHMARK_FROM_V1 = 0.57;
const RAYS_OF_SCALE = 800; // whose hits tell how large the shape is

/** What the encoders say of an image. */
export interface Encoded {
  camera: [number, number, number]; // azimuth and elevation in radians, radius in benchmark units
  modulations: Float32Array;
}

/** A network whose states carry factors, as a plain one: W_l diag(m_{l-1}). */
export function modulated(layers: Layer[], modulations: Float32Array): Layer[] {
  let at = 0;
  return layers.map((layer, index) => {
    if (index === 0) return layer;
    const factors = modulations.subarray(at, at + layer.columns);
    at += layer.columns;
    return { ...layer, weight: layer.weight.map((value, i) => value * factors[i % layer.columns]!) };
  });
}

export class Reconstruction {
  readonly panel = element("fieldset", {}, element("legend", {}, "Image"));
  scale = 1; // v1 units per unit of the field
  encoded: Encoded | null = null; // of the image that is shown
  index: number | null = null; // of the sample that is
  private model: Model | null = null;
  private readonly shown = element("img", { alt: "The image that is reconstructed", class: "input" });
  private readonly said = element("p", { class: "note", role: "status" });

  constructor(
    private readonly record: ModelRecord,
    private readonly layers: Layer[],
    private readonly engine: WebglEngine,
    private readonly view: View,
    private readonly cloud: Cloud,
  ) {
    const file = element("input", { type: "file", accept: "image/png,image/webp", id: "image" });
    file.addEventListener("change", () => file.files?.[0] && this.take(file.files[0]));
    const samples = record.samples.map((address, index) => {
      const made = element("button", { type: "button", class: "sample" }, element("img", { src: address, alt: `Sample ${index + 1}` }));
      made.addEventListener("click", () => void this.sample(index));
      return made;
    });
    const drop = element("label", { class: "drop", for: "image" }, "Drop an RGBA image here, or choose one");
    this.panel.append(this.shown, element("div", { class: "row" }, ...samples), drop, file, this.said);
    document.body.addEventListener("dragover", (event) => event.preventDefault());
    document.body.addEventListener("drop", (event) => {
      event.preventDefault();
      const dropped = event.dataTransfer?.files[0];
      if (dropped) this.take(dropped);
    });
  }

  async sample(index: number): Promise<void> {
    const [, text] = (this.record.samples[index] ?? this.record.samples[0]!).split(",");
    await this.take(new Blob([Uint8Array.from(atob(text!), (letter) => letter.charCodeAt(0))], { type: "image/png" }));
    this.index = index;
  }

  /** Show what an image file shows; says what is wrong with it. */
  async take(file: Blob): Promise<void> {
    this.said.textContent = "reading the image";
    this.index = null;
    try {
      const pixels = await read(file);
      URL.revokeObjectURL(this.shown.src);
      this.shown.src = URL.createObjectURL(file);
      const started = performance.now();
      const found = await this.encode(encoderInput(pixels, this.record.image_size));
      const encoders = Math.round(performance.now() - started);
      this.encoded = found;
      this.engine.replace(modulated(this.layers, found.modulations));
      this.scale = 1 / spread(await hits(this.view.world, undefined, RAYS_OF_SCALE));
      this.cloud.points = [];
      this.view.distances.forget();
      if (this.cloud.shown) await this.cloud.show(true);
      this.view.camera = this.seenFrom(found.camera);
      this.view.refresh(false);
      const [azimuth, elevation] = found.camera.map((angle) => Math.round((angle * 180) / Math.PI));
      this.said.textContent = `camera ${azimuth}°, ${elevation}°; encoders ${encoders} ms`;
    } catch (error) {
      this.said.textContent = (error as Error).message;
    }
  }

  async encode(planes: Float32Array): Promise<Encoded> {
    const { image_size: size } = this.record;
    this.model ??= await window.ddfWasm!.open((await readBlock("ddf-runtime"))!, (await readBlock("ddf-model"))!);
    const found = await this.model.run({ images: { data: planes, shape: [1, 4, size, size] } }, ["camera", "modulations"]);
    return { camera: Array.from(found.camera!) as Encoded["camera"], modulations: found.modulations! };
  }

  /** The camera of the image about the field, whose box is a cube of side 2; radii of the page are in shares of its diagonal. */
  private seenFrom([azimuth, elevation, radius]: Encoded["camera"]): Camera {
    const degrees = 180 / Math.PI;
    const away = radius / BENCHMARK_FROM_V1 / this.scale; // field units
    return {
      azimuth: azimuth * degrees,
      elevation: elevation * degrees,
      radius: (BENCHMARK_FROM_V1 * away) / (2 * Math.sqrt(3)),
      target: centre(this.view.stage),
    };
  }
}
