// SPDX-License-Identifier: MIT
// From places in a square to pixels, in the very steps of OpenCV: its sums in another order differ in the last bit, and
// where a place lies between two 32nds of a pixel that is another pixel, and a face a tenth of a pixel away.

const BLOCK = 64; // warpPerspective goes along rows in pieces of so many pixels

/**
 * Places in 32nds of a pixel for every pixel of a size x size square, row by row.
 * corners: of the square in the picture; left below, left above, right above, right below.
 */
export function places(corners, size) {
  const from = corners.map((corner) => corner.map(Math.fround));
  const m = inverse(perspective(from, [[0, size], [0, 0], [size, 0], [size, size]]));
  const found = [new Int32Array(size * size), new Int32Array(size * size)];
  for (let y = 0; y < size; y++) {
    for (let start = 0; start < size; start += BLOCK) {
      const [x0, y0, w0] = [0, 3, 6].map((k) => m[k] * start + m[k + 1] * y + m[k + 2]);
      for (let x = start; x < Math.min(start + BLOCK, size); x++) {
        const along = x - start;
        const w = 32 / (w0 + m[6] * along);
        found[0][y * size + x] = nearest((x0 + m[0] * along) * w);
        found[1][y * size + x] = nearest((y0 + m[3] * along) * w);
      }
    }
  }
  return found;
}

/** getPerspectiveTransform: nine numbers. */
function perspective(from, to) {
  const rows = [0, 1].flatMap((k) =>
    from.map(([x, y], n) => {
      const ahead = [x, y, 1], none = [0, 0, 0];
      return [...(k ? none : ahead), ...(k ? ahead : none), -x * to[n][k], -y * to[n][k]];
    }),
  );
  return [...solved(rows, [0, 1].flatMap((k) => to.map((place) => place[k]))), 1];
}

/** solve with DECOMP_LU. */
function solved(a, b) {
  const size = b.length;
  for (let i = 0; i < size; i++) {
    let pivot = i;
    for (let j = i + 1; j < size; j++) if (Math.abs(a[j][i]) > Math.abs(a[pivot][i])) pivot = j;
    [a[i], a[pivot]] = [a[pivot], a[i]];
    [b[i], b[pivot]] = [b[pivot], b[i]];
    const d = -1 / a[i][i];
    for (let j = i + 1; j < size; j++) {
      const alpha = a[j][i] * d;
      for (let k = i + 1; k < size; k++) a[j][k] += alpha * a[i][k];
      b[j] += alpha * b[i];
    }
  }
  for (let i = size - 1; i >= 0; i--) {
    let s = b[i];
    for (let k = i + 1; k < size; k++) s -= a[i][k] * b[k];
    b[i] = s / a[i][i];
  }
  return b;
}

/** invert of a 3 x 3 matrix. */
function inverse([a, b, c, d, e, f, g, h, i]) {
  const share = 1 / (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g));
  return [
    e * i - f * h, c * h - b * i, b * f - c * e,
    f * g - d * i, a * i - c * g, c * d - a * f,
    d * h - e * g, b * g - a * h, a * e - b * d,
  ].map((value) => value * share);
}

/** The nearest whole number, of two the even one. */
function nearest(value) {
  const up = Math.round(value);
  return up - value === 0.5 && up % 2 ? up - 1 : up;
}
