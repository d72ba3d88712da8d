// SPDX-License-Identifier: MIT
// What goes wrong, said in one line: what, and what to do.

/** An error whose message is for the person before the page. */
export class Said extends Error {}

const CAMERA = {
  NotAllowedError: "The camera was refused: allow it for this page in the browser's address bar, then try again.",
  SecurityError: "The camera was refused: this page may not use it where it is embedded.",
  NotFoundError: "No camera was found: connect one, or open a picture or a video.",
  NotReadableError: "The camera cannot be used: another program has it, or the system withholds it.",
  AbortError: "The camera did not start: another program may have it.",
  OverconstrainedError: "That camera is gone: choose another one.",
};

/** What getUserMedia throws. */
export function cameraTrouble(error) {
  return new Said(CAMERA[error.name] ?? `The camera did not start (${error.name}: ${error.message}).`);
}

/** Of the networks, which everything needs. */
export function loadingTrouble(error) {
  if (typeof WebAssembly !== "object") {
    return new Said("This browser has no WebAssembly, in which the networks run: switch it on, or use another browser.");
  }
  return new Said(`The networks cannot be loaded (${error.message ?? error}): reload the page, or use a newer browser.`);
}
