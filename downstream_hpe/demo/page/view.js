// SPDX-License-Identifier: MIT
// What is shown of a picture and its pose: axes on the face, numbers, words. Colours and lengths are those of
// downstream_hpe/prediction/drawing.py.

import { boxOf } from "./detector.js";

const AXES = [[255, 60, 60], [60, 210, 60], [70, 130, 255]]; // image-right, down, ahead of the nose
const GREY = [185, 185, 185];
const FADED = 0.7;
const EDGE = "rgb(15 15 15)";
const LARGEST = 2048; // pixels of the longer side that are shown

const ANGLES = ["yaw", "pitch", "roll"];
const DIRECTIONS = [["to its right", "to its left"], ["up", "down"], ["to its left", "to its right"]];

/** Shows pixels on two canvases that lie on each other: the picture, and the axes of a face. */
export function showPicture(picture, axes, pixels, face, pose) {
  const scale = Math.min(1, LARGEST / Math.max(pixels.width, pixels.height));
  const [width, height] = [pixels.width, pixels.height].map((side) => Math.max(1, Math.round(side * scale)));
  for (const canvas of [picture, axes]) {
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  }
  const context = picture.getContext("2d");
  if (scale === 1) {
    context.putImageData(pixels, 0, 0);
  } else {
    const whole = new OffscreenCanvas(pixels.width, pixels.height);
    whole.getContext("2d").putImageData(pixels, 0, 0);
    context.imageSmoothingQuality = "high";
    context.drawImage(whole, 0, 0, width, height);
  }
  const drawing = axes.getContext("2d");
  drawing.clearRect(0, 0, width, height);
  if (pose) drawAxes(drawing, face, pose, scale);
}

function drawAxes(context, face, { rotation, sure }, scale) {
  const { low, high } = boxOf(face);
  const centre = [0, 1].map((k) => ((low[k] + high[k]) / 2) * scale);
  const length = 0.6 * Math.max(high[0] - low[0], high[1] - low[1]) * scale;
  const thick = Math.max(3, length / 28, Math.max(context.canvas.width, context.canvas.height) / 160);
  const edge = Math.max(1.5, thick / 5);
  // The nose looks along -z of its own frame, towards the camera at pose zero.
  const ends = AXES.map((colour, k) => {
    const away = k === 2 ? -1 : 1;
    const faded = colour.map((value, i) => Math.round(sure ? value : (1 - FADED) * value + FADED * GREY[i]));
    return { direction: [rotation[k], rotation[3 + k], rotation[6 + k]].map((v) => away * v), colour: `rgb(${faded.join(" ")})` };
  });
  // Far ends first, so that the nearer axis covers the farther one.
  ends.sort((a, b) => b.direction[2] - a.direction[2]);
  context.lineCap = "round";
  for (const { direction, colour } of ends) {
    const end = [0, 1].map((k) => centre[k] + length * direction[k]);
    for (const [wider, fill] of [[edge, EDGE], [0, colour]]) {
      context.strokeStyle = context.fillStyle = fill;
      context.lineWidth = thick + 2 * wider;
      context.beginPath();
      context.moveTo(...centre);
      context.lineTo(...end);
      context.stroke();
      context.beginPath();
      context.arc(...end, thick + wider, 0, 2 * Math.PI);
      context.fill();
    }
  }
}

/** Numbers and words on the page. pose: null where no face is found, undefined before anything was looked at. */
export function showNumbers(page, pose, facts) {
  for (const [k, name] of ANGLES.entries()) {
    const angle = pose?.angles[k];
    page.querySelector(`#${name}`).textContent = pose ? degrees(angle) : "–";
    page.querySelector(`#${name}-way`).textContent = pose && Math.abs(angle) >= 0.5 ? DIRECTIONS[k][Number(angle < 0)] : "";
  }
  const confidence = pose ? Math.round(100 * pose.confidence) : null;
  page.querySelector("#confidence").textContent = pose ? `${confidence} %` : "–";
  page.querySelector("#meter").value = pose ? pose.confidence : 0;
  const numbers = page.querySelector("#numbers");
  numbers.dataset.state = pose === undefined ? "none" : !pose ? "missed" : pose.sure ? "sure" : "unsure";
  numbers.dataset.pose = pose ? JSON.stringify([...pose.angles, pose.confidence]) : "";
  page.querySelector("#word").textContent = word(pose, facts);
}

/** The pose in one sentence, for those who do not see the page. */
export function sentence(pose, facts) {
  if (!pose) return word(pose, facts);
  const angles = ANGLES.map((name, k) => `${name} ${degrees(pose.angles[k])}`).join(", ");
  return `${angles}; confidence ${Math.round(100 * pose.confidence)} %. ${word(pose, facts)}`;
}

function word(pose, { range_deg: range, low_confidence: low }) {
  if (pose === undefined) return "";
  if (pose === null) return "No face found.";
  const words = [];
  if (pose.confidence < low) words.push("Low confidence: it may be hidden, blurred, or no face at all.");
  if (!pose.inRange) {
    words.push(`Outside the trained range: ${ANGLES.map((name, k) => `${name} ${between(range[k])}`).join(", ")}.`);
  }
  return words.join(" ") || "Plausible, and within the trained range.";
}

function between([low, high]) {
  return low === -high ? `±${high}°` : `${degrees(low, 0)} to ${degrees(high, 0)}`;
}

function degrees(value, digits = 1) {
  const text = Math.abs(value).toFixed(digits);
  const sign = Number(text) === 0 ? "" : value < 0 ? "−" : "+";
  return `${sign}${text}°`;
}
