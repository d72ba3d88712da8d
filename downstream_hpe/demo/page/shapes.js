// SPDX-License-Identifier: MIT
// Whether landmarks are those of a face: downstream_hpe/prediction/plausibility.py.

import { rotationOnto } from "./linear.js";

const EVERY = 3; // a third of the landmarks says as much
const LEAST = 1e-9;
const [FOREHEAD, CHIN] = [10, 152];

export class FaceShapes {
  /** What facts.json has of them: mean, basis, weights, bias, doubted, steep, upright_deg. */
  constructor(facts) {
    Object.assign(this, facts);
    this.some = picked(this.mean);
  }

  /** 0 to 1. landmarks: Float64Array of 468 (x, y, z). */
  plausibility(landmarks) {
    const face = picked(landmarks);
    const count = face.length / 3;
    const middle = [0, 0, 0];
    for (let n = 0; n < face.length; n++) middle[n % 3] += face[n] / count;
    let squares = 0;
    for (let n = 0; n < face.length; n++) {
      face[n] -= middle[n % 3];
      squares += face[n] ** 2 / count;
    }
    const size = Math.max(Math.sqrt(squares), LEAST);
    const r = rotationOnto(face, this.some);
    const residual = new Float64Array(face.length);
    for (let n = 0; n < face.length; n += 3) {
      for (let i = 0; i < 3; i++) {
        const level = r[3 * i] * face[n] + r[3 * i + 1] * face[n + 1] + r[3 * i + 2] * face[n + 2];
        residual[n + i] = level / size - this.some[n + i];
      }
    }
    const dot = (a, b) => a.reduce((sum, value, n) => sum + value * b[n], 0);
    const along = this.basis.map((direction) => dot(direction, residual));
    const left = dot(residual, residual) - dot(along, along);
    const quantities = [...along, 0.5 * Math.log(Math.max(left, LEAST))];
    return 1 / (1 + Math.exp(dot(this.weights, quantities) - this.bias));
  }

  /** What is left of a confidence where a face is doubtful, 0 to 1. */
  share(landmarks) {
    return 1 / (1 + (this.doubted / Math.max(this.plausibility(landmarks), LEAST)) ** this.steep);
  }

  /** By how many quarter turns, clockwise in the picture, a face is from upright: 0 to 3. */
  quarterTurns(landmarks) {
    const [x, y] = [0, 1].map((k) => landmarks[3 * CHIN + k] - landmarks[3 * FOREHEAD + k]);
    const lean = (Math.atan2(-x, y) * 180) / Math.PI;
    return Math.abs(lean) < this.upright_deg ? 0 : (Math.round(lean / 90) + 4) % 4;
  }
}

/** Every third point. */
function picked(points) {
  const some = new Float64Array(Math.ceil(points.length / 3 / EVERY) * 3);
  for (let n = 0; n < some.length; n++) some[n] = points[EVERY * (n - (n % 3)) + (n % 3)];
  return some;
}
