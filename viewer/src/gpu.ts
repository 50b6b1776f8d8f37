/** A WebGL2 context as what the passes of `webgl.ts` need: array textures of floats, draws into them, reads from them. */

import { VERTEX } from "./shaders.ts";

export const WIDTH = 128; // rays side by side in a texture
const SLOTS = ["source", "slopes", "values"] as const;

export interface States {
  texture: WebGLTexture;
  blocks: number;
  id: number;
}

export type Inputs = Partial<Record<(typeof SLOTS)[number], States | undefined>>;

export class Gpu {
  private readonly programs = new Map<string, WebGLProgram>();
  private readonly targets = new Map<string, WebGLFramebuffer>();
  private readonly states = new Map<string, States>();
  height = 1; // rows of rays in the textures of the network at hand
  used = 1; // of those, in the chunk at hand

  private constructor(readonly gl: WebGL2RenderingContext) {
    gl.bindVertexArray(gl.createVertexArray());
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
  }

  /** Whether a CPU imitates it. */
  get isSoftware(): boolean {
    const names = this.gl.getExtension("WEBGL_debug_renderer_info");
    const renderer: string = names ? this.gl.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
    return /swiftshader|llvmpipe|software/i.test(renderer);
  }

  /** The GPU of the machine, or why it will not do. */
  static open(): Gpu | string {
    const canvas = document.createElement("canvas");
    const gl = canvas.getContext("webgl2", { antialias: false, depth: false, alpha: false });
    if (!gl) return "this browser has no WebGL2";
    if (!gl.getExtension("EXT_color_buffer_float")) return "this GPU does not draw into float textures";
    return new Gpu(gl);
  }

  /** One draw over all rays of the chunk: blocks `first` and on of every target. */
  draw(
    key: string,
    source: string,
    inputs: Inputs,
    outs: States[],
    first: number,
    blocks: number,
    component = 0,
  ): void {
    const { gl } = this;
    const program = this.program(key, source);
    gl.useProgram(program);
    SLOTS.forEach((slot, index) => {
      gl.activeTexture(gl.TEXTURE0 + index);
      gl.bindTexture(gl.TEXTURE_2D_ARRAY, inputs[slot]?.texture ?? null);
    });
    gl.uniform1i(gl.getUniformLocation(program, "first"), first);
    gl.uniform1i(gl.getUniformLocation(program, "component"), component);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer(outs, first, blocks));
    gl.viewport(0, 0, WIDTH, this.used);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  read(states: States): Float32Array {
    const { gl } = this;
    const values = new Float32Array(4 * WIDTH * this.used);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer([states], 0, 1));
    gl.readPixels(0, 0, WIDTH, this.used, gl.RGBA, gl.FLOAT, values);
    return values;
  }

  /** All zero. */
  clear(states: States): void {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, this.framebuffer([states], 0, 1));
    this.gl.clearBufferfv(this.gl.COLOR, 0, [0, 0, 0, 0]);
  }

  /** Texels of all blocks of the rows in use. */
  upload(states: States, texels: Float32Array): void {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, states.texture);
    gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, 0, WIDTH, this.used, states.blocks, gl.RGBA, gl.FLOAT, texels);
  }

  /** Weights of the next draw: a part of a buffer. */
  bind(buffer: WebGLBuffer, offset: number, bytes: number): void {
    this.gl.bindBufferRange(this.gl.UNIFORM_BUFFER, 0, buffer, offset, bytes);
  }

  buffer(data: Float32Array): WebGLBuffer {
    const buffer = this.gl.createBuffer();
    this.gl.bindBuffer(this.gl.UNIFORM_BUFFER, buffer);
    this.gl.bufferData(this.gl.UNIFORM_BUFFER, data, this.gl.STATIC_DRAW);
    return buffer;
  }

  private program(key: string, fragment: string): WebGLProgram {
    const known = this.programs.get(key);
    if (known) return known;
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(kind)!;
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      const shader = gl.getAttachedShaders(program)?.[1];
      throw new Error(`shader ${key}: ${gl.getProgramInfoLog(program)} ${shader ? gl.getShaderInfoLog(shader) : ""}`);
    }
    gl.useProgram(program);
    SLOTS.forEach((slot, index) => gl.uniform1i(gl.getUniformLocation(program, slot), index));
    const block = gl.getUniformBlockIndex(program, "Weights");
    if (block !== gl.INVALID_INDEX) gl.uniformBlockBinding(program, block, 0);
    this.programs.set(key, program);
    return program;
  }

  /** States of that name and size; the first to ask makes them. */
  array(name: string, blocks: number): States {
    const key = `${name} ${blocks} ${this.height}`;
    const known = this.states.get(key);
    if (known) return known;
    const { gl } = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, texture);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA32F, WIDTH, this.height, blocks);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    const states = { texture, blocks, id: this.states.size };
    this.states.set(key, states);
    return states;
  }

  private framebuffer(outs: States[], first: number, blocks: number): WebGLFramebuffer {
    const key = `${outs.map((states) => states.id)} ${first} ${blocks}`;
    const known = this.targets.get(key);
    if (known) return known;
    const { gl } = this;
    const framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    const attachments: number[] = [];
    for (const states of outs) {
      for (let block = first; block < first + blocks; block++) {
        const point = gl.COLOR_ATTACHMENT0 + attachments.length;
        gl.framebufferTextureLayer(gl.FRAMEBUFFER, point, states.texture, 0, block);
        attachments.push(point);
      }
    }
    gl.drawBuffers(attachments);
    this.targets.set(key, framebuffer);
    return framebuffer;
  }
}
