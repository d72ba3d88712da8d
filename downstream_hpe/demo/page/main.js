// SPDX-License-Identifier: MIT
// The page: what its buttons do, and what happens to a picture.

import { FaceDetector, WayUp } from "./detector.js";
import { TurningHead } from "./head.js";
import { FaceMesh } from "./mesh.js";
import { loadNetworks } from "./networks.js";
import { pixelsOf } from "./pixels.js";
import { Predictor } from "./pose.js";
import { loadingTrouble, Said } from "./said.js";
import { FaceShapes } from "./shapes.js";
import { cameras, changed, close, nextFrame, openCamera, openFile } from "./sources.js";
import { Steady } from "./steady.js";
import { sentence, showNumbers, showPicture } from "./view.js";

const LEVEL = [1, 0, 0, 0, 1, 0, 0, 0, 1];
const $ = (id) => document.getElementById(id);

let facts, detector, predictor, head;
let shown = null; // what is being looked at: { video, live }, or {} for a picture; another one ends it

/** more: for those who do not see the rest of the page. */
function say(text, more = "") {
  const unseen = Object.assign(document.createElement("span"), { className: "unseen", textContent: ` ${more}` });
  $("status").replaceChildren(text, ...(more ? [unseen] : []));
}

function complain(error) {
  if (!(error instanceof Said)) console.error(error);
  $("trouble").textContent = error instanceof Said ? error.message : `Something went wrong (${error.message ?? error}).`;
  $("trouble").hidden = false;
}

/** Ends what is shown; what comes next belongs to the answer. */
function begin() {
  if (shown?.video) close(shown.video);
  shown = {};
  $("trouble").hidden = true;
  $("stop").hidden = $("playback").hidden = $("which-label").hidden = true;
  document.body.classList.remove("live");
  return shown;
}

/** No picture and no numbers: those of before would be taken for those of what could not be read. */
function forget() {
  delete $("stage").dataset.filled;
  for (const id of ["picture", "axes"]) $(id).getContext("2d").clearRect(0, 0, $(id).width, $(id).height);
  showNumbers(document, undefined, facts.pose);
  head.draw(LEVEL, true);
  say("");
}

/** Whatever is asked for, with what goes wrong said on the page. */
async function attempt(action) {
  const mine = begin();
  document.body.dataset.state = "busy";
  try {
    await action(mine);
    if (shown !== mine) return;
  } catch (error) {
    if (shown !== mine) return;
    begin();
    forget();
    complain(error);
  }
  document.body.dataset.state = "ready";
}

async function look(pixels, find) {
  const face = await find(pixels);
  const pose = face && (await predictor.pose(face));
  return { face, pose };
}

/** time: of a frame, seconds. */
function show(pixels, { face, pose }, time = "") {
  $("stage").dataset.filled = "";
  $("numbers").dataset.time = time;
  showPicture($("picture"), $("axes"), pixels, face, pose);
  showNumbers(document, pose, facts.pose);
  head.draw(pose ? pose.rotation : LEVEL, !pose?.sure);
}

function openFiles(files) {
  if (!files.length) return;
  attempt(async (mine) => {
    const [file] = files;
    say(`Opening ${file.name} …`);
    const { picture, video } = await openFile(file, facts.pictures);
    if (shown !== mine) return video && close(video);
    if (video) return play(mine, video, file.name);
    const found = await look(picture, (pixels) => detector.face(pixels));
    if (shown !== mine) return;
    show(picture, found);
    say(`${file.name}: ${picture.width} x ${picture.height} pixels.`, sentence(found.pose, facts.pose));
  });
}

function startCamera(device) {
  attempt(async (mine) => {
    say("Waiting for the camera …");
    const video = await openCamera(device, () => shown === mine && lost());
    if (shown !== mine) return close(video);
    Object.assign(mine, { video, live: true });
    await offerCameras(video);
    await play(mine, video, "Camera");
  });
}

function lost() {
  begin();
  forget();
  document.body.dataset.state = "ready";
  complain(new Said("The camera has stopped: it was unplugged, or the system took it."));
}

async function offerCameras(video) {
  const every = await cameras();
  const current = video.srcObject.getVideoTracks()[0].getSettings().deviceId;
  $("which").replaceChildren(...every.map(({ label, deviceId }, n) => new Option(label || `Camera ${n + 1}`, deviceId, false, deviceId === current)));
  $("which-label").hidden = every.length < 2;
}

/** Frame by frame, each shown together with what was found on it, until something else is asked for. */
async function play(mine, video, name) {
  mine.video = video;
  const wayUp = new WayUp(detector);
  const steady = new Steady(facts.smoothing);
  document.body.classList.toggle("live", Boolean(mine.live));
  $("stop").hidden = false;
  $("playback").hidden = Boolean(mine.live);
  say(`${name}: ${mine.live ? "running" : "playing"}; every frame is looked at on this machine.`);
  document.body.dataset.state = "playing";
  let canvas = null;
  while (shown === mine) {
    const [width, height] = [video.videoWidth, video.videoHeight];
    if (canvas?.width !== width || canvas?.height !== height) canvas = new OffscreenCanvas(width, height);
    const pixels = pixelsOf(video, width, height, canvas);
    const time = mine.live ? performance.now() / 1000 : video.currentTime;
    const found = await look(pixels, (picture) => wayUp.face(picture, time));
    if (shown !== mine) return;
    if (!found.pose || !$("smooth").checked) steady.forget();
    else found.pose = predictor.posed(steady.next(found.pose.rotation, found.face, time), found.pose.confidence);
    show(pixels, found, time);
    if (!mine.live) {
      $("time").max = video.duration;
      if (document.activeElement !== $("time") || !video.paused) $("time").value = video.currentTime;
      $("pause").textContent = video.ended ? "Again" : video.paused ? "Play" : "Pause";
    }
    await Promise.race([nextFrame(video), changed(video, ["pause", "ended", "seeked", "play", "emptied"])]);
  }
}

function wire() {
  $("camera").addEventListener("click", () => startCamera($("which").value));
  $("which").addEventListener("change", () => startCamera($("which").value));
  $("file").addEventListener("change", ({ target }) => {
    openFiles([...target.files]);
    target.value = ""; // the same file may be opened again
  });
  $("stop").addEventListener("click", () => {
    begin();
    document.body.dataset.state = "ready";
    say("Stopped.");
  });
  $("pause").addEventListener("click", () => {
    const { video } = shown;
    if (video.paused || video.ended) video.play();
    else video.pause();
  });
  $("time").addEventListener("input", () => (shown.video.currentTime = $("time").value));
  $("mirror").addEventListener("change", () => document.body.classList.toggle("mirrored", $("mirror").checked));
  addEventListener("dragover", (event) => {
    event.preventDefault();
    $("stage").classList.add("over");
  });
  for (const name of ["dragleave", "drop"]) addEventListener(name, () => $("stage").classList.remove("over"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    openFiles([...event.dataTransfer.files]);
  });
}

async function fetched(path, read) {
  const answer = await fetch(new URL(path, import.meta.url));
  if (!answer.ok) throw new Said(`${path} is missing where this page comes from: write the page again.`);
  return answer[read]();
}

async function start() {
  try {
    facts = await fetched("./model/facts.json", "json");
    head = new TurningHead($("head"), await fetched("./head.bin", "arrayBuffer"));
    head.draw(LEVEL, true);
    const networks = await loadNetworks((share) => ($("loading").value = share));
    const shapes = new FaceShapes(facts.shapes);
    detector = new FaceDetector(new FaceMesh(networks), shapes, facts.detector);
    predictor = new Predictor(networks.graph, shapes, facts.pose);
  } catch (error) {
    say("");
    document.body.dataset.state = "failed";
    return complain(error instanceof Said ? error : loadingTrouble(error));
  }
  showNumbers(document, undefined, facts.pose);
  for (const control of document.querySelectorAll("[disabled]")) control.disabled = false;
  wire();
  document.body.dataset.state = "ready";
  say("Ready: use the camera, or open or drop a picture or a video.");
}

start();
