// SPDX-License-Identifier: MIT
// Less jitter in video without lag in fast turns, as downstream_hpe/prediction/smoothing.py and tracks.py.

import { placeOf } from "./detector.js";
import { angleOf, nearestRotation, product, transposed } from "./linear.js";

/** Casiez, Roussel and Vogel, "1 Euro Filter", CHI 2012, with the angular speed as the speed. */
export class OneEuroFilter {
  /** facts: min_cutoff, beta, speed_cutoff. */
  constructor(facts) {
    this.facts = facts;
    this.speed = 0;
  }

  /** The filtered rotation. Times, in seconds, rise; the first one passes unchanged. */
  next(rotation, time) {
    if (this.smooth) {
      const step = time - this.time;
      const now = angleOf(product(transposed(this.raw), rotation)) / step;
      this.speed += share(this.facts.speed_cutoff, step) * (now - this.speed);
      const part = share(this.facts.min_cutoff + this.facts.beta * this.speed, step);
      this.smooth = nearestRotation(this.smooth.map((value, n) => part * rotation[n] + (1 - part) * value));
    } else {
      this.smooth = rotation;
    }
    Object.assign(this, { raw: rotation, time });
    return this.smooth;
  }
}

function share(cutoff, step) {
  return 1 / (1 + 1 / (2 * Math.PI * cutoff * step));
}

/** The poses of one video: filtered as long as it is the same face. */
export class Steady {
  /** facts: those of the filter, and memory_s. */
  constructor(facts) {
    this.facts = facts;
    this.forget();
  }

  /** Whoever comes next is filtered afresh. */
  forget() {
    this.filter = null;
  }

  /** The rotation of a face at a time in seconds. */
  next(rotation, face, time) {
    const place = placeOf(face);
    if (!this.filter || !this.same(place, time)) this.filter = new OneEuroFilter(this.facts);
    this.place = place;
    return time === this.filter.time ? this.filter.smooth : this.filter.next(rotation, time);
  }

  same({ centre, size }, time) {
    const [x, y] = this.place.centre;
    const gone = time - this.filter.time;
    return gone >= 0 && gone <= this.facts.memory_s && Math.hypot(centre[0] - x, centre[1] - y) < size;
  }
}
