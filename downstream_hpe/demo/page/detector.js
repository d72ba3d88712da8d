// SPDX-License-Identifier: MIT
// The face of a picture: Face Mesh, closer looks where it is small, turned ones where it is doubtful.
// As downstream_hpe/prediction/detector.py, which says why, and way_up.py for video.

import { angleOf, rotationOnto } from "./linear.js";
import { part, turned } from "./pixels.js";

export class FaceDetector {
  /** facts: those of facts.json for the detector. */
  constructor(mesh, shapes, facts) {
    Object.assign(this, { mesh, shapes, facts });
  }

  /** Landmarks of the most prominent face, Float64Array of 468 (x, y, z) in pixels, or null. */
  async face(picture, every = true) {
    let found = await this.mesh.mesh(picture);
    if (found) {
      const place = placeOf(found);
      const small = place.size < this.facts.large_enough * Math.max(picture.width, picture.height);
      found = (small && (await this.closer(picture, place))) || found;
    } else {
      for (const place of await this.mesh.places(picture)) {
        found ||= await this.closer(picture, place);
      }
    }
    if (!every) return found;
    return found ? this.lookedAtAgain(picture, found) : this.onItsSide(picture);
  }

  plausible(face) {
    return this.shapes.plausibility(face) > this.facts.doubtful;
  }

  async closer(picture, place) {
    const { left, top, square } = this.square(picture, place);
    const face = square && (await this.mesh.mesh(square));
    if (!face) return null;
    const moved = shifted(face, left, top);
    return around(moved, place.centre) ? moved : null;
  }

  async onItsSide(picture) {
    for (const quarter of [2, 1, 3]) {
      const face = await this.turnedFace(picture, quarter);
      if (face && this.plausible(face)) return face;
    }
    return null;
  }

  async lookedAtAgain(picture, face) {
    if (this.plausible(face)) return face;
    const { left, top, square } = this.square(picture, placeOf(face));
    const others = [];
    for (const quarter of [1, 3, 2]) {
      const other = await this.turnedFace(square, quarter);
      if (!other || this.alike(face, other) || !others.every((one) => this.alike(one, other))) return face;
      others.push(shifted(other, left, top));
    }
    const said = others.map((other) => this.shapes.plausibility(other));
    const mean = said.reduce((sum, value) => sum + value, 0) / said.length;
    return mean > this.facts.doubtful ? others[said.indexOf(Math.max(...said))] : null;
  }

  async turnedFace(picture, quarter) {
    const face = await this.mesh.mesh(turned(picture, quarter));
    return face && turnedBack(face, picture, quarter);
  }

  /** Left and top, and what of the picture lies in the square for a closer look. */
  square(picture, { centre, size }) {
    const reach = (this.facts.closer / 2) * size;
    const [left, top] = centre.map((value) => Math.trunc(Math.max(value - reach, 0)));
    const [right, bottom] = centre.map((value) => Math.trunc(Math.max(value + reach, 0)));
    return { left, top, square: part(picture, left, top, right, bottom) };
  }

  alike(face, other) {
    const onto = rotationOnto(centred(face), centred(other));
    return angleOf(onto) < this.facts.alike_deg;
  }
}

/** Which way up a video is looked at: as the frame before, and every way where that shows no plausible face. */
export class WayUp {
  constructor(detector) {
    this.detector = detector;
    this.quarter = 0;
    this.tried = -Infinity;
  }

  /** As FaceDetector.face. time: seconds. */
  async face(picture, time) {
    const seen = await this.detector.face(turned(picture, this.quarter), false);
    const found = seen && turnedBack(seen, picture, this.quarter);
    if ((found && this.detector.plausible(found)) || Math.abs(time - this.tried) < this.detector.facts.patience_s) {
      return found;
    }
    this.tried = time;
    const again = await this.detector.face(picture, true);
    if (again && this.detector.plausible(again)) this.quarter = this.detector.shapes.quarterTurns(again);
    return again ?? found;
  }
}

/** Landmarks found in a turned picture, in the pixels of the picture as it is. */
function turnedBack(points, picture, quarter) {
  const back = Float64Array.from(points);
  for (let turn = quarter - 1; turn >= 0; turn--) {
    const width = turn % 2 ? picture.height : picture.width;
    for (let n = 0; n < back.length; n += 3) [back[n], back[n + 1]] = [width - back[n + 1], back[n]];
  }
  return back;
}

/** The box of a face's landmarks. */
export function boxOf(face) {
  const box = { low: [Infinity, Infinity], high: [-Infinity, -Infinity] };
  for (let n = 0; n < face.length; n += 3) {
    for (const k of [0, 1]) {
      box.low[k] = Math.min(box.low[k], face[n + k]);
      box.high[k] = Math.max(box.high[k], face[n + k]);
    }
  }
  return box;
}

/** Centre and longer side of that box. */
export function placeOf(face) {
  const { low, high } = boxOf(face);
  return {
    centre: [0, 1].map((k) => (low[k] + high[k]) / 2),
    size: Math.max(high[0] - low[0], high[1] - low[1]),
  };
}

function around(face, point) {
  const { low, high } = boxOf(face);
  return [0, 1].every((k) => point[k] >= low[k] && point[k] <= high[k]);
}

function shifted(face, left, top) {
  return face.map((value, n) => value + [left, top, 0][n % 3]);
}

function centred(face) {
  const middle = [0, 0, 0];
  face.forEach((value, n) => (middle[n % 3] += (3 * value) / face.length));
  return face.map((value, n) => value - middle[n % 3]);
}
