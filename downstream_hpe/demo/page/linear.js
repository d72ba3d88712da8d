// SPDX-License-Identifier: MIT
// Rotations: 3 x 3 matrices as nine numbers, row by row. Frame C: x right, y down, z into the scene.

const DEGREE = Math.PI / 180;

/** R_C of (yaw, pitch, roll) in degrees, as downstream_hpe/geometry/rotation.py has it. */
export function rotationFromAngles([yaw, pitch, roll]) {
  const [cy, sy] = [Math.cos(yaw * DEGREE), Math.sin(yaw * DEGREE)];
  const [cp, sp] = [Math.cos(pitch * DEGREE), Math.sin(pitch * DEGREE)];
  const [cr, sr] = [Math.cos(roll * DEGREE), Math.sin(roll * DEGREE)];
  return [
    cy * cr, -cy * sr, sy,
    cp * sr - sp * sy * cr, cp * cr + sp * sy * sr, sp * cy,
    -sp * sr - cp * sy * cr, -sp * cr + cp * sy * sr, cp * cy,
  ];
}

/** (yaw, pitch, roll) in degrees of R_C. */
export function anglesFromRotation(r) {
  const yaw = Math.asin(Math.min(1, Math.max(-1, r[2])));
  return [yaw, Math.atan2(r[5], r[8]), Math.atan2(-r[1], r[0])].map((angle) => angle / DEGREE);
}

/** The product of two. */
export function product(a, b) {
  return Array.from(a, (_, n) => {
    const [row, column] = [n - (n % 3), n % 3];
    return a[row] * b[column] + a[row + 1] * b[column + 3] + a[row + 2] * b[column + 6];
  });
}

/** The rotation back. */
export function transposed(a) {
  return Array.from(a, (_, n) => a[3 * (n % 3) + Math.floor(n / 3)]);
}

/** By how much a rotation turns, degrees. */
export function angleOf(r) {
  const cosine = (r[0] + r[4] + r[8] - 1) / 2;
  return Math.acos(Math.min(1, Math.max(-1, cosine))) / DEGREE;
}

/** The rotation that brings points onto others in the least squares, both [x, y, z, x, ...] about their means. */
export function rotationOnto(from, to) {
  const m = new Float64Array(9);
  for (let p = 0; p < from.length; p += 3) {
    for (let i = 0; i < 3; i++) {
      for (let j = 0; j < 3; j++) m[3 * j + i] += from[p + i] * to[p + j];
    }
  }
  return nearestRotation(m);
}

/**
 * The rotation nearest to a matrix, in the least squares of their numbers.
 * Horn, JOSA A 4(4), 1987: the main eigenvector of a symmetric 4 x 4 matrix is its quaternion.
 */
export function nearestRotation(m) {
  const [xx, yx, zx, xy, yy, zy, xz, yz, zz] = m;
  const [w, x, y, z] = mainEigenvector([
    [xx + yy + zz, yz - zy, zx - xz, xy - yx],
    [yz - zy, xx - yy - zz, xy + yx, zx + xz],
    [zx - xz, xy + yx, yy - xx - zz, yz + zy],
    [xy - yx, zx + xz, yz + zy, zz - xx - yy],
  ]);
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
  ];
}

const SWEEPS = 12; // of Jacobi's method, which needs about six to the last digit

function mainEigenvector(a) {
  const size = a.length;
  const vectors = a.map((_, i) => a.map((_, j) => Number(i === j)));
  for (let sweep = 0; sweep < SWEEPS; sweep++) {
    for (let p = 0; p < size; p++) {
      for (let q = p + 1; q < size; q++) {
        if (a[p][q] === 0) continue;
        const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(theta, 1));
        const [c, n] = [1 / Math.hypot(t, 1), t / Math.hypot(t, 1)];
        for (let k = 0; k < size; k++) {
          [a[k][p], a[k][q]] = [c * a[k][p] - n * a[k][q], n * a[k][p] + c * a[k][q]];
        }
        for (let k = 0; k < size; k++) {
          [a[p][k], a[q][k]] = [c * a[p][k] - n * a[q][k], n * a[p][k] + c * a[q][k]];
          [vectors[k][p], vectors[k][q]] = [
            c * vectors[k][p] - n * vectors[k][q],
            n * vectors[k][p] + c * vectors[k][q],
          ];
        }
      }
    }
  }
  const main = a.reduce((best, row, k) => (row[k] > a[best][best] ? k : best), 0);
  return vectors.map((row) => row[main]);
}
