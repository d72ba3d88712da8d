// SPDX-License-Identifier: MIT
// Pictures as pixels: { data: RGBA bytes, width, height }, and rotated squares cut out of them.

import { places } from "./perspective.js";

/** The pixels of anything that can be drawn, as they are. */
export function pixelsOf(source, width, height, canvas = new OffscreenCanvas(width, height)) {
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(source, 0, 0, width, height);
  return context.getImageData(0, 0, width, height);
}

/** What lies between two corners, as far as the picture goes. */
export function part(picture, left, top, right, bottom) {
  const [across, down] = [Math.min(right, picture.width) - left, Math.min(bottom, picture.height) - top];
  if (across <= 0 || down <= 0) return null;
  const data = new Uint8ClampedArray(4 * across * down);
  for (let y = 0; y < down; y++) {
    const start = 4 * ((top + y) * picture.width + left);
    data.set(picture.data.subarray(start, start + 4 * across), 4 * y * across);
  }
  return { data, width: across, height: down };
}

/** Turned by so many quarters, counter-clockwise, as np.rot90 does it. */
export function turned(picture, quarter) {
  if (quarter === 0) return picture;
  const { width, height } = picture;
  const from = new Uint32Array(picture.data.buffer, picture.data.byteOffset, width * height);
  const [across, down] = quarter % 2 ? [height, width] : [width, height];
  const to = new Uint32Array(width * height);
  for (let y = 0; y < down; y++) {
    for (let x = 0; x < across; x++) {
      const source =
        quarter === 1 ? x * width + (width - 1 - y)
        : quarter === 2 ? (height - 1 - y) * width + (width - 1 - x)
        : (height - 1 - x) * width + y;
      to[y * across + x] = from[source];
    }
  }
  return { data: new Uint8ClampedArray(to.buffer), width: across, height: down };
}

/** A square of a picture: centre in pixels, side, and angle in radians, clockwise as one sees it. */
export class Square {
  constructor(centre, side, angle = 0) {
    Object.assign(this, { centre, side, angle });
    this.right = [side * Math.cos(angle), side * Math.sin(angle)];
    this.down = [-this.right[1], this.right[0]];
  }

  /** The upright one that just holds a picture. */
  static around({ width, height }) {
    return new Square([width / 2, height / 2], Math.max(width, height));
  }

  /** A place in it, 0 to 1, as a pixel of the picture. */
  pixel(x, y) {
    return [0, 1].map((k) => (x - 0.5) * this.right[k] + (y - 0.5) * this.down[k] + this.centre[k]);
  }

  /**
   * Its content as float32, size * size * 3, from low to 1. Beyond the edge lies the last pixel or black.
   *
   * As OpenCV's warpPerspective does it, and so MediaPipe: places are whole 32nds of a pixel, weights whole 1024ths.
   */
  cut(picture, size, low, replicate) {
    const { data, width, height } = picture;
    const offset = (x, y) => {
      if (x >= 0 && y >= 0 && x < width && y < height) return 4 * (y * width + x);
      if (!replicate) return -1;
      return 4 * (Math.min(Math.max(y, 0), height - 1) * width + Math.min(Math.max(x, 0), width - 1));
    };
    const [across, down] = places([this.pixel(0, 1), this.pixel(0, 0), this.pixel(1, 0), this.pixel(1, 1)], size);
    const cut = new Float32Array(3 * size * size);
    const scale = Math.fround((1 - low) / 255);
    let at = 0;
    for (let n = 0; n < size * size; n++) {
      const [x, y, right, below] = [across[n] >> 5, down[n] >> 5, across[n] & 31, down[n] & 31];
      const corners = [offset(x, y), offset(x + 1, y), offset(x, y + 1), offset(x + 1, y + 1)];
      const weights = [(32 - right) * (32 - below), right * (32 - below), (32 - right) * below, right * below];
      for (let channel = 0; channel < 3; channel++) {
        let sum = 512;
        for (let k = 0; k < 4; k++) if (corners[k] >= 0) sum += weights[k] * data[corners[k] + channel];
        cut[at++] = Math.fround((sum >> 10) * scale) + low;
      }
    }
    return cut;
  }
}
