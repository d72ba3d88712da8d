// SPDX-License-Identifier: MIT
// Where pictures come from: a file of one, a video, the camera.

import { pixelsOf } from "./pixels.js";
import { cameraTrouble, Said } from "./said.js";

/** What of a file: { picture } or { video }, a playing element. facts: max_pixels. */
export async function openFile(file, facts) {
  if (!file.size) throw new Said(`${file.name}: an empty file, no picture and no video.`);
  if (file.type.startsWith("video/")) return { video: await openVideo(file) };
  if (file.type.startsWith("image/")) return { picture: await openPicture(file, facts) };
  // The ending says nothing: whichever it can be read as.
  const read = [async () => ({ picture: await openPicture(file, facts) }), async () => ({ video: await openVideo(file) })];
  for (const attempt of read) {
    try {
      return await attempt();
    } catch (error) {
      if (!(error instanceof Said)) throw error;
      if (error.final) throw error;
    }
  }
  throw new Said(`${file.name}: neither a picture nor a video that this browser can read.`);
}

async function openPicture(file, { max_pixels: most }) {
  const [width, height] = await sizeOf(file);
  if (!width || !height) throw new Said(`${file.name}: a picture of no size.`);
  if (width * height > most) {
    const error = new Said(
      `${file.name}: ${width} x ${height} pixels, more than ${Math.round(most / 1e6)} megapixels: make it smaller.`,
    );
    throw Object.assign(error, { final: true });
  }
  try {
    // As the numbers lie in the file, which is what downstream-hpe predict looks at.
    const bitmap = await createImageBitmap(file, { colorSpaceConversion: "none", premultiplyAlpha: "none" });
    const picture = pixelsOf(bitmap, bitmap.width, bitmap.height);
    bitmap.close();
    return picture;
  } catch (error) {
    if (!(error instanceof DOMException) && !(error instanceof RangeError)) throw error;
    throw new Said(`${file.name}: cannot be read to its end; it may be damaged, or too large for this browser.`);
  }
}

/** By its header: nothing is decoded yet. */
async function sizeOf(file) {
  const image = new Image();
  const address = URL.createObjectURL(file);
  try {
    await new Promise((resolve, reject) => {
      Object.assign(image, { onload: resolve, onerror: reject, src: address });
    });
    return [image.naturalWidth, image.naturalHeight];
  } catch {
    const heic = /\.hei[cf]$/i.test(file.name) ? " Save it as JPEG first." : "";
    throw new Said(`${file.name}: not a picture that this browser can read.${heic}`);
  } finally {
    URL.revokeObjectURL(address);
  }
}

async function openVideo(file) {
  const video = element();
  const address = URL.createObjectURL(file);
  try {
    await started(video, () => (video.src = address));
  } catch {
    URL.revokeObjectURL(address);
    throw new Said(`${file.name}: this browser cannot play it: it is no video, damaged, or of a codec that it lacks.`);
  }
  if (!video.videoWidth) throw new Said(`${file.name}: sound alone, or a codec of pictures that this browser lacks.`);
  return video;
}

/** The camera as a playing element. device: its id, or none for the first. ended: called when it stops by itself. */
export async function openCamera(device, ended) {
  if (!navigator.mediaDevices?.getUserMedia) {
    throw new Said("No camera on a page from there: open it from https:// or from localhost.");
  }
  const wanted = device ? { deviceId: { exact: device } } : { facingMode: "user" };
  let stream;
  try {
    stream = await navigator.mediaDevices.getUserMedia({
      video: { ...wanted, width: { ideal: 1280 }, height: { ideal: 720 } },
    });
  } catch (error) {
    throw cameraTrouble(error);
  }
  stream.getVideoTracks()[0].addEventListener("ended", ended);
  const video = element();
  await started(video, () => (video.srcObject = stream));
  return video;
}

/** Every camera, with a label where the browser tells. */
export async function cameras() {
  const devices = await navigator.mediaDevices.enumerateDevices();
  return devices.filter(({ kind }) => kind === "videoinput");
}

/** Ends a video or camera and frees what it holds. */
export function close(video) {
  video.pause();
  for (const track of video.srcObject?.getTracks() ?? []) track.stop();
  if (video.src) URL.revokeObjectURL(video.src);
  video.removeAttribute("src");
  video.srcObject = null;
}

/** Resolves when one of these events comes to the video. */
export function changed(video, events) {
  return new Promise((resolve) => events.forEach((name) => video.addEventListener(name, resolve, { once: true })));
}

/** Resolves when the video shows another frame. */
export function nextFrame(video) {
  if (video.requestVideoFrameCallback) return new Promise((resolve) => video.requestVideoFrameCallback(resolve));
  return new Promise((resolve) => requestAnimationFrame(resolve));
}

function element() {
  return Object.assign(document.createElement("video"), { muted: true, playsInline: true, preload: "auto" });
}

/** Plays, and shows its first frame: what is drawn of a video before that may be empty. */
async function started(video, begin) {
  await new Promise((resolve, reject) => {
    Object.assign(video, { onloadeddata: resolve, onerror: reject });
    begin();
  });
  const shown = nextFrame(video);
  await video.play();
  if (video.videoWidth && !video.ended) await Promise.race([shown, changed(video, ["ended"])]);
}
