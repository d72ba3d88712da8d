// SPDX-License-Identifier: MIT
// Landmarks in, head pose out: the model's graph, as downstream_hpe/prediction/predictor.py asks it.

import { anglesFromRotation, product, rotationFromAngles } from "./linear.js";

export class Predictor {
  /** graph: landmarks, Float32Array of 1404 -> { ypr_deg, rotation, confidence }. facts: range_deg, low_confidence. */
  constructor(graph, shapes, facts) {
    Object.assign(this, { graph, shapes, facts });
  }

  /** { angles, rotation, confidence, inRange, sure }: yaw, pitch, roll in degrees; R_C; 0 to 1. */
  async pose(landmarks) {
    const points = Float32Array.from(landmarks);
    const quarters = this.shapes.quarterTurns(points);
    const turns = rotationFromAngles([0, 0, 90 * quarters]);
    if (quarters) turn(points, turns); // the model knows upright faces alone
    const found = await this.graph(points);
    const rotation = quarters ? product(turns, found.rotation) : Array.from(found.rotation);
    return this.posed(rotation, found.confidence[0] * this.shapes.share(points));
  }

  /** As above, of a rotation and a confidence. */
  posed(rotation, confidence) {
    const angles = anglesFromRotation(rotation);
    const inRange = angles.every((angle, k) => angle >= this.facts.range_deg[k][0] && angle <= this.facts.range_deg[k][1]);
    return { angles, rotation, confidence, inRange, sure: inRange && confidence >= this.facts.low_confidence };
  }
}

/** Points (rows) times a rotation, in place. */
function turn(points, r) {
  for (let n = 0; n < points.length; n += 3) {
    const [x, y, z] = points.subarray(n, n + 3);
    for (let k = 0; k < 3; k++) points[n + k] = x * r[k] + y * r[3 + k] + z * r[6 + k];
  }
}
