/**
 * GLSL of the passes. A pixel is a ray, a layer of an array texture is a block of four units, and a draw gives up to four
 * blocks of one layer's units for all rays. Weights come in a uniform block, the same for all pixels of a draw.
 */

/** What a product's sums a become. `sine` sin a; `sine+slope` cos a too; `adjoint` a c; `adjoint+bend` a h too. */
export type Epilogue = "linear" | "sine" | "sine+slope" | "adjoint" | "adjoint+bend";

export interface Product {
  inputs: number; // blocks that are summed over
  blocks: number; // blocks that a draw gives
  epilogue: Epilogue;
  sloped: boolean; // whether the input is multiplied by `slopes` of its block
}

export const VERTEX = `#version 300 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

const HEADER = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2DArray;
`;

const range = (count: number): number[] => [...Array(count).keys()];

/**
 * Sine and cosine of a, whatever the GPU's own are good for: a - k π/2 in [-π/4, π/4], with π/2 in three parts, and the
 * polynomials of Cephes (Moshier 1992) there.
 */
const ANGLE = `vec4 sine, cosine;
void angle(vec4 a) {
  vec4 k = round(a * 0.6366197723675814);
  vec4 r = ((a - k * 1.5703125) - k * 4.837512969970703e-4) - k * 7.54978995489188e-8;
  vec4 z = r * r;
  vec4 s = r + r * z * (-1.6666654611e-1 + z * (8.3321608736e-3 - z * 1.9515295891e-4));
  vec4 c = 1.0 - 0.5 * z + z * z * (4.166664568298827e-2 + z * (-1.388731625493765e-3 + z * 2.443315711809948e-5));
  vec4 quarter = k - 4.0 * floor(0.25 * k);
  bvec4 odd = equal(abs(quarter - 2.0), vec4(1.0));
  sine = mix(s, c, odd) * mix(vec4(1.0), vec4(-1.0), greaterThan(quarter, vec4(1.5)));
  cosine = mix(c, s, odd) * mix(vec4(1.0), vec4(-1.0), equal(abs(quarter - 1.5), vec4(0.5)));
}`;

export function product({ inputs, blocks, epilogue, sloped }: Product): string {
  const two = epilogue === "sine+slope" || epilogue === "adjoint+bend";
  const ends: Record<Epilogue, (b: number) => string> = {
    linear: (b) => `o${b} = a${b};`,
    sine: (b) => `angle(a${b}); o${b} = sine;`,
    "sine+slope": (b) => `angle(a${b}); o${b} = sine; o${blocks + b} = cosine;`,
    adjoint: (b) => `o${b} = a${b} * texelFetch(slopes, ivec3(at, first + ${b}), 0);`,
    "adjoint+bend": (b) =>
      `o${b} = a${b} * texelFetch(slopes, ivec3(at, first + ${b}), 0);
  o${blocks + b} = a${b} * texelFetch(values, ivec3(at, first + ${b}), 0);`,
  };
  const outs = range(two ? 2 * blocks : blocks).map((b) => `layout(location = ${b}) out vec4 o${b};`);
  return `${HEADER}
uniform sampler2DArray source, slopes, values;
uniform int first;
layout(std140) uniform Weights { mat4 w[${inputs * blocks}]; vec4 bias[${blocks}]; };
${outs.join("\n")}
${epilogue.startsWith("sine") ? ANGLE : ""}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 ${range(blocks).map((b) => `a${b} = bias[${b}]`).join(", ")};
  for (int k = 0; k < ${inputs}; k++) {
    vec4 x = texelFetch(source, ivec3(at, k), 0)${sloped ? " * texelFetch(slopes, ivec3(at, k), 0)" : ""};
    ${range(blocks).map((b) => `a${b} += w[${b * inputs} + k] * x;`).join("\n    ")}
  }
  ${range(blocks).map(ends[epilogue]).join("\n  ")}
}`;
}

/** s_L = c_L g_L with g_L the head's row of one component: 0 the heavier one, else the one of that number. */
export function start(blocks: number, bend: boolean): string {
  return `${HEADER}
uniform sampler2DArray source, slopes, values;
uniform int first, component;
layout(std140) uniform Weights { vec4 rows[${2 * blocks}]; };
${range(bend ? 2 * blocks : blocks).map((b) => `layout(location = ${b}) out vec4 o${b};`).join("\n")}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  bool one = component == 1 || (component == 0 && texelFetch(source, ivec3(at, 0), 0).z >= 0.0);
  ${range(blocks)
    .map(
      (b) => `vec4 g${b} = one ? rows[${b}] : rows[${blocks + b}];
  o${b} = g${b} * texelFetch(slopes, ivec3(at, first + ${b}), 0);
  ${bend ? `o${blocks + b} = g${b} * texelFetch(values, ivec3(at, first + ${b}), 0);` : ""}`,
    )
    .join("\n  ")}
}`;
}

/** Two unit vectors normal to the gradient and to each other (Duff et al. 2017), as `derivatives.tangent_basis`. */
export const BASIS = `${HEADER}
uniform sampler2DArray source;
layout(location = 0) out vec4 o0;
layout(location = 1) out vec4 o1;
void main() {
  vec3 n = texelFetch(source, ivec3(gl_FragCoord.xy, 0), 0).xyz;
  n /= max(length(n), 1e-12);
  float side = n.z >= 0.0 ? 1.0 : -1.0;
  float a = -1.0 / (side + n.z), b = n.x * n.y * a;
  o0 = vec4(1.0 + side * n.x * n.x * a, side * b, -side * n.x, 0.0);
  o1 = vec4(b, side + n.y * n.y * a, -n.y, 0.0);
}`;

/** sum + Σ_k (g h)_k t_k². */
export const bending = (inputs: number): string => `${HEADER}
uniform sampler2DArray source, slopes, values; // t, g h, the sum so far
layout(location = 0) out vec4 o0;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 sum = texelFetch(values, ivec3(at, 0), 0);
  for (int k = 0; k < ${inputs}; k++) {
    vec4 t = texelFetch(source, ivec3(at, k), 0);
    sum += texelFetch(slopes, ivec3(at, k), 0) * t * t;
  }
  o0 = sum;
}`;
