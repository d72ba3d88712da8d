// SPDX-License-Identifier: MIT
// Where faces are: what MediaPipe's detectors of boxes say, as litert_faces/boxes.py reads it.

import { Square } from "./pixels.js";

const VALUES = 16; // a box: centre, size, six points of the face
const STRIDES = { 896: [[8, 2], [16, 6]], 2304: [[4, 1]] };
const OVERLAP = 0.3;
const HIGHEST = 100;

/** Finds faces: { score, low, high, points }, pixels, the surest first. points: the eyes first, right one ahead. */
export class BoxDetector {
  constructor(network) {
    this.network = network;
    this.anchors = anchors(network.size, STRIDES[network.lengths[1]]);
  }

  async find(picture, minConfidence) {
    const whole = Square.around(picture);
    const [values, scores] = await this.network.run(whole.cut(picture, this.network.size, -1, false));
    const found = merged(decoded(values, scores, this.anchors, this.network.size, minConfidence));
    const pixel = ([x, y]) => whole.pixel(x, y);
    return found.map((box) => ({
      score: box.score, low: pixel(box.low), high: pixel(box.high), points: box.points.map(pixel),
    }));
  }
}

/** Middles of the cells of each grid, 0 to 1, row by row. */
function anchors(size, strides) {
  const places = [];
  for (const [stride, many] of strides) {
    const cells = Math.floor(size / stride);
    for (let y = 0; y < cells; y++) {
      for (let x = 0; x < cells; x++) {
        const middle = [((x + 0.5) * stride) / size, ((y + 0.5) * stride) / size];
        for (let k = 0; k < many; k++) places.push(middle);
      }
    }
  }
  return places;
}

function decoded(values, scores, places, size, minConfidence) {
  const boxes = [];
  places.forEach(([x, y], n) => {
    const score = 1 / (1 + Math.exp(-Math.min(HIGHEST, Math.max(-HIGHEST, scores[n]))));
    if (score < minConfidence) return;
    const pairs = Array.from({ length: VALUES / 2 }, (_, k) => [0, 1].map((i) => values[n * VALUES + 2 * k + i] / size));
    const [[cx, cy], [width, height], ...points] = pairs;
    if (width < 0 || height < 0) return;
    boxes.push({
      score,
      low: [cx + x - width / 2, cy + y - height / 2],
      high: [cx + x + width / 2, cy + y + height / 2],
      points: points.map(([px, py]) => [px + x, py + y]),
    });
  });
  return boxes.sort((a, b) => b.score - a.score);
}

/** One a face: the mean of those that overlap the surest, weighted by how sure they are; and again of the rest. */
function merged(boxes) {
  const kept = [];
  let rest = boxes;
  while (rest.length) {
    const first = rest[0];
    const same = rest.filter((box) => box === first || shared(box, first) > OVERLAP);
    const total = same.reduce((sum, box) => sum + box.score, 0);
    const mean = (pick) => [0, 1].map((k) => same.reduce((sum, box) => sum + (box.score / total) * pick(box)[k], 0));
    kept.push({
      score: first.score,
      low: mean((box) => box.low),
      high: mean((box) => box.high),
      points: first.points.map((_, n) => mean((box) => box.points[n])),
    });
    rest = rest.filter((box) => !same.includes(box));
  }
  return kept;
}

/** Intersection over union. */
function shared(a, b) {
  const area = (box) => (box.high[0] - box.low[0]) * (box.high[1] - box.low[1]);
  const reach = [0, 1].map((k) => Math.max(0, Math.min(a.high[k], b.high[k]) - Math.max(a.low[k], b.low[k])));
  const both = reach[0] * reach[1];
  return both > 0 ? both / (area(a) + area(b) - both) : 0;
}
