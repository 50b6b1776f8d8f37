// Products and sines of a network on the CPU, in AssemblyScript. States are [unit][ray], RAYS rays of a tile side by side.

const ROW: usize = 4 * 32; // bytes of a unit: RAYS of `wasm.ts`

// @ts-ignore: decorator
@inline
function sum(a: v128, b: v128, c: v128): v128 {
  return f32x4.add(f32x4.mul(a, b), c);
}

// @ts-ignore: decorator
@inline
function all(x: f32): v128 {
  return f32x4.splat(x);
}

/** out = W x + b, four rows and eight rays at a time; weights are four rows' first columns, their second, and so on. */
export function product(weights: usize, biases: usize, x: usize, out: usize, rows: usize, columns: usize): void {
  for (let row: usize = 0; row < rows; row += 4) {
    const end = weights + 16 * columns;
    for (let ray: usize = 0; ray < ROW; ray += 32) {
      let a0 = v128.load32_splat(biases), a1 = v128.load32_splat(biases, 4), a2 = v128.load32_splat(biases, 8), a3 = v128.load32_splat(biases, 12);
      let b0 = a0, b1 = a1, b2 = a2, b3 = a3;
      let from = x + ray;
      for (let w = weights; w < end; w += 16, from += ROW) {
        const p = v128.load(from), q = v128.load(from, 16);
        const w0 = v128.load32_splat(w);
        a0 = sum(w0, p, a0);
        b0 = sum(w0, q, b0);
        const w1 = v128.load32_splat(w, 4);
        a1 = sum(w1, p, a1);
        b1 = sum(w1, q, b1);
        const w2 = v128.load32_splat(w, 8);
        a2 = sum(w2, p, a2);
        b2 = sum(w2, q, b2);
        const w3 = v128.load32_splat(w, 12);
        a3 = sum(w3, p, a3);
        b3 = sum(w3, q, b3);
      }
      const to = out + row * ROW + ray;
      v128.store(to, a0);
      v128.store(to, b0, 16);
      v128.store(to + ROW, a1);
      v128.store(to + ROW, b1, 16);
      v128.store(to + 2 * ROW, a2);
      v128.store(to + 2 * ROW, b2, 16);
      v128.store(to + 3 * ROW, a3);
      v128.store(to + 3 * ROW, b3, 16);
    }
    weights = end;
    biases += 16;
  }
}

/** Sines in place, and cosines where there is a place for them; the numbers are those of `ANGLE` in `shaders.ts`. */
export function sines(at: usize, cosines: usize, units: usize): void {
  const half = i32x4.splat(0x80000000);
  for (const end = at + units * ROW; at < end; at += 16) {
    const a = v128.load(at);
    const k = f32x4.nearest(f32x4.mul(a, all(0.6366197723675814)));
    const r = sum(k, all(-7.54978995489188e-8), sum(k, all(-4.837512969970703e-4), sum(k, all(-1.5703125), a)));
    const z = f32x4.mul(r, r);
    const s = sum(f32x4.mul(r, z), sum(z, sum(z, all(-1.9515295891e-4), all(8.3321608736e-3)), all(-1.6666654611e-1)), r);
    const d = sum(z, sum(z, all(2.443315711809948e-5), all(-1.388731625493765e-3)), all(4.166664568298827e-2));
    const c = sum(f32x4.mul(z, z), d, sum(z, all(-0.5), all(1)));
    const quarter = i32x4.trunc_sat_f32x4_s(k);
    const odd = i32x4.shr_s(i32x4.shl(quarter, 31), 31);
    v128.store(at, v128.xor(v128.bitselect(c, s, odd), v128.and(i32x4.shl(quarter, 30), half)));
    if (!cosines) continue;
    const next = i32x4.add(quarter, i32x4.splat(1));
    v128.store(cosines, v128.xor(v128.bitselect(s, c, odd), v128.and(i32x4.shl(next, 30), half)));
    cosines += 16;
  }
}

/** out = a b. */
export function times(a: usize, b: usize, out: usize, units: usize): void {
  for (let at: usize = 0; at < units * ROW; at += 16) v128.store(out + at, f32x4.mul(v128.load(a + at), v128.load(b + at)));
}

/** total += Σ_k b_k t_k². */
export function bending(b: usize, t: usize, total: usize, units: usize): void {
  for (let at: usize = 0; at < units * ROW; at += 16) {
    const to = total + (at & (ROW - 1));
    v128.store(to, sum(v128.load(b + at), f32x4.mul(v128.load(t + at), v128.load(t + at)), v128.load(to)));
  }
}
