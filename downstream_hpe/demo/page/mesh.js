// SPDX-License-Identifier: MIT
// A picture in, Face Mesh's 468 points of its surest face out: as litert_faces/finder.py, each picture on its own.

import { BoxDetector } from "./boxes.js";
import { Square } from "./pixels.js";

const ROOM = 1.5; // side of the square, in longer sides of the box
const LEAST_PRESENCE = 0.5;
const CONFIDENCE = 0.5;

export class FaceMesh {
  /** networks: near, far and points, each with size, lengths and run. */
  constructor({ near, far, points }) {
    this.near = new BoxDetector(near);
    this.far = new BoxDetector(far);
    this.points = points;
  }

  /** Float64Array of 468 (x, y, z), isotropic pixels, or null where no face is found. */
  async mesh(picture) {
    const [box] = await this.near.find(picture, CONFIDENCE);
    if (!box) return null;
    const [width, height] = [0, 1].map((k) => box.high[k] - box.low[k]);
    const [right, left] = box.points;
    const centre = [0, 1].map((k) => (box.low[k] + box.high[k]) / 2);
    const angle = Math.atan2(left[1] - right[1], left[0] - right[0]);
    const square = new Square(centre, ROOM * Math.max(width, height), angle);
    const size = this.points.size;
    const [values, [presence]] = await this.points.run(square.cut(picture, size, 0, true));
    if (!(1 / (1 + Math.exp(-presence)) > LEAST_PRESENCE)) return null;
    const found = new Float64Array(values.length);
    for (let n = 0; n < values.length; n += 3) {
      [found[n], found[n + 1]] = square.pixel(values[n] / size, values[n + 1] / size);
      found[n + 2] = (square.side * values[n + 2]) / size;
    }
    return found;
  }

  /** Centres and sizes of faces that a detector finds which sees those half as large. */
  async places(picture) {
    const boxes = await this.far.find(picture, CONFIDENCE);
    return boxes.map(({ low, high }) => ({
      centre: [0, 1].map((k) => (low[k] + high[k]) / 2),
      size: Math.max(high[0] - low[0], high[1] - low[1]),
    }));
  }
}
