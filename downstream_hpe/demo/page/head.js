// SPDX-License-Identifier: MIT
// The head that turns along: a small renderer with a depth buffer, so that no WebGL is needed.

const HEIGHT_MM = 300; // of what the picture shows
const MIDDLE_MM = [0, 5, 0]; // what is in its middle, from the pivot
const LIGHT = [-0.45, -0.55, -0.7]; // towards it, frame C
const SHADE = 0.32;

export class TurningHead {
  /** bytes: head.bin, see scripts/make_demo_head.py. */
  constructor(canvas, bytes) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    const [vertices, triangles] = new Uint32Array(bytes, 0, 2);
    this.points = Float32Array.from(new Int16Array(bytes, 8, 3 * vertices), (value, n) => value / 100 - MIDDLE_MM[n % 3]);
    this.colours = new Uint8Array(bytes, 8 + 6 * vertices, 4 * vertices);
    this.triangles = new Uint16Array(bytes.slice(8 + 10 * vertices, 8 + 10 * vertices + 6 * triangles));
    this.normals = normals(this.points, this.triangles);
    this.seen = new Float32Array(this.points.length);
    this.light = new Float32Array(vertices);
    const length = Math.hypot(...LIGHT);
    this.towards = LIGHT.map((value) => value / length);
    this.depth = new Float32Array(0);
  }

  /** R_C, nine numbers. faded: the pose may not be believed. */
  draw(r, faded = false) {
    const { width, height } = this.canvas;
    const image = this.context.createImageData(width, height);
    if (this.depth.length !== width * height) this.depth = new Float32Array(width * height);
    this.depth.fill(Infinity);
    this.turn(r, height / HEIGHT_MM, width / 2, height / 2);
    const { triangles } = this;
    for (let n = 0; n < triangles.length; n += 3) {
      this.fill(image, triangles[n], triangles[n + 1], triangles[n + 2], faded ? 0.55 : 1);
    }
    this.context.putImageData(image, 0, 0);
  }

  clear() {
    this.context.clearRect(0, 0, this.canvas.width, this.canvas.height);
  }

  turn(r, scale, x0, y0) {
    const { points, normals, seen, light, towards } = this;
    for (let n = 0; n < points.length; n += 3) {
      const [x, y, z] = [points[n], points[n + 1], points[n + 2]];
      seen[n] = x0 + scale * (r[0] * x + r[1] * y + r[2] * z);
      seen[n + 1] = y0 + scale * (r[3] * x + r[4] * y + r[5] * z);
      seen[n + 2] = r[6] * x + r[7] * y + r[8] * z;
      const [a, b, c] = [normals[n], normals[n + 1], normals[n + 2]];
      const lit =
        (r[0] * a + r[1] * b + r[2] * c) * towards[0] +
        (r[3] * a + r[4] * b + r[5] * c) * towards[1] +
        (r[6] * a + r[7] * b + r[8] * c) * towards[2];
      light[n / 3] = SHADE + (1 - SHADE) * Math.max(0, 0.25 + 0.75 * lit);
    }
  }

  fill(image, a, b, c, alpha) {
    const { seen, light, colours, depth } = this;
    const [ax, ay, bx, by, cx, cy] = [seen[3 * a], seen[3 * a + 1], seen[3 * b], seen[3 * b + 1], seen[3 * c], seen[3 * c + 1]];
    const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
    if (area === 0) return;
    const [left, right] = [Math.max(0, Math.ceil(Math.min(ax, bx, cx))), Math.min(image.width - 1, Math.floor(Math.max(ax, bx, cx)))];
    const [top, bottom] = [Math.max(0, Math.ceil(Math.min(ay, by, cy))), Math.min(image.height - 1, Math.floor(Math.max(ay, by, cy)))];
    const { data, width } = image;
    const [za, zb, zc] = [seen[3 * a + 2], seen[3 * b + 2], seen[3 * c + 2]];
    // How much of each corner a place is, which grows evenly along a row.
    const [stepB, stepC] = [(cy - ay) / area, (ay - by) / area];
    for (let y = top; y <= bottom; y++) {
      let wb = ((left - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area;
      let wc = ((bx - ax) * (y - ay) - (by - ay) * (left - ax)) / area;
      for (let x = left; x <= right; x++, wb += stepB, wc += stepC) {
        const wa = 1 - wb - wc;
        if (wa < 0 || wb < 0 || wc < 0) continue;
        const at = y * width + x;
        const z = wa * za + wb * zb + wc * zc;
        if (z >= depth[at]) continue;
        depth[at] = z;
        const lit = wa * light[a] + wb * light[b] + wc * light[c];
        data[4 * at] = lit * (wa * colours[4 * a] + wb * colours[4 * b] + wc * colours[4 * c]);
        data[4 * at + 1] = lit * (wa * colours[4 * a + 1] + wb * colours[4 * b + 1] + wc * colours[4 * c + 1]);
        data[4 * at + 2] = lit * (wa * colours[4 * a + 2] + wb * colours[4 * b + 2] + wc * colours[4 * c + 2]);
        data[4 * at + 3] = 255 * alpha;
      }
    }
  }
}

/** Of every vertex, outwards: those of its triangles, weighted by their size. */
function normals(points, triangles) {
  const sums = new Float32Array(points.length);
  for (let n = 0; n < triangles.length; n += 3) {
    const [a, b, c] = [3 * triangles[n], 3 * triangles[n + 1], 3 * triangles[n + 2]];
    const [u, v] = [b, c].map((end) => [0, 1, 2].map((k) => points[end + k] - points[a + k]));
    const across = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    for (const at of [a, b, c]) for (let k = 0; k < 3; k++) sums[at + k] += across[k];
  }
  for (let n = 0; n < sums.length; n += 3) {
    const length = Math.hypot(sums[n], sums[n + 1], sums[n + 2]) || 1;
    for (let k = 0; k < 3; k++) sums[n + k] /= length;
  }
  return sums;
}
