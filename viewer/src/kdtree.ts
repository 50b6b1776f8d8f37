/** Nearest points, by a balanced tree that halves them along x, y, z in turn. */

export interface Near {
  index: Int32Array; // nearest first
  squared: Float64Array; // distances
}

export class KdTree {
  private readonly order: Int32Array; // rows of points; the middle of a range parts it
  private readonly sought: [number, number, number] = [0, 0, 0];

  /** points: 3 numbers each. */
  constructor(private readonly points: Float64Array) {
    this.order = Int32Array.from({ length: points.length / 3 }, (_, row) => row);
    this.part(0, this.order.length - 1, 0);
  }

  /** Fill `near` with as many of the points as it takes; what is left over keeps an infinite distance. */
  find(x: number, y: number, z: number, near: Near): void {
    this.sought[0] = x;
    this.sought[1] = y;
    this.sought[2] = z;
    near.squared.fill(Infinity);
    near.index.fill(-1);
    this.search(0, this.order.length - 1, 0, near);
  }

  private search(low: number, high: number, axis: number, near: Near): void {
    if (low > high) return;
    const middle = (low + high) >> 1;
    const row = this.order[middle]!;
    const { points, sought } = this;
    const [a, b, c] = [points[3 * row]! - sought[0], points[3 * row + 1]! - sought[1], points[3 * row + 2]! - sought[2]];
    keep(near, row, a * a + b * b + c * c);
    const beyond = axis === 0 ? a : axis === 1 ? b : c; // of the point, seen from what is sought
    const next = (axis + 1) % 3;
    if (beyond > 0) this.search(low, middle - 1, next, near);
    else this.search(middle + 1, high, next, near);
    if (beyond * beyond >= near.squared[near.squared.length - 1]!) return;
    if (beyond > 0) this.search(middle + 1, high, next, near);
    else this.search(low, middle - 1, next, near);
  }

  /** Halve a range by the median of an axis (quickselect), then its halves. */
  private part(low: number, high: number, axis: number): void {
    if (low >= high) return;
    const middle = (low + high) >> 1;
    const { order, points } = this;
    for (let [left, right] = [low, high]; left < right; ) {
      const pivot = points[3 * order[middle]! + axis]!;
      let [i, j] = [left, right];
      while (i <= j) {
        while (points[3 * order[i]! + axis]! < pivot) i++;
        while (points[3 * order[j]! + axis]! > pivot) j--;
        if (i > j) break;
        [order[i], order[j]] = [order[j]!, order[i]!];
        i++;
        j--;
      }
      if (j < middle) left = i;
      if (middle < i) right = j;
    }
    this.part(low, middle - 1, (axis + 1) % 3);
    this.part(middle + 1, high, (axis + 1) % 3);
  }
}

function keep(near: Near, row: number, squared: number): void {
  let at = near.squared.length - 1;
  if (squared >= near.squared[at]!) return;
  for (; at > 0 && near.squared[at - 1]! > squared; at--) {
    near.squared[at] = near.squared[at - 1]!;
    near.index[at] = near.index[at - 1]!;
  }
  near.squared[at] = squared;
  near.index[at] = row;
}
