// SPDX-License-Identifier: MIT
// The networks at work, on this machine's processor: MediaPipe's by LiteRT, ours by onnxruntime.

import { CompiledModel, loadAndCompile, loadLiteRt, Tensor } from "./vendor/litert/index.js";
import * as onnxruntime from "./vendor/onnxruntime/ort.wasm.min.mjs";

/** { near, far, points } of MediaPipe and { graph } of ours. progress: called with 0 to 1. */
export async function loadNetworks(progress) {
  const here = (path) => new URL(path, import.meta.url).href;
  onnxruntime.env.wasm.numThreads = 1;
  onnxruntime.env.wasm.wasmPaths = {
    mjs: here("./vendor/onnxruntime/ort-wasm-simd-threaded.mjs"),
    wasm: here("./vendor/onnxruntime/ort-wasm-simd-threaded.wasm"),
  };
  await loadLiteRt(here("./vendor/litert/litert_wasm_compat_internal.js"));
  progress(0.4);
  const network = async (name) => new Network(await loadAndCompile(here(`./vendor/mediapipe/${name}.tflite`), { accelerator: "wasm" }));
  const [near, far, points] = [
    await network("face_detection_short_range"),
    await network("face_detection_full_range_sparse"),
    await network("face_landmark"),
  ];
  progress(0.6);
  const session = await onnxruntime.InferenceSession.create(here("./model/headturn.onnx"), {
    executionProviders: ["wasm"],
  });
  progress(1);
  const graph = async (landmarks) => {
    const input = new onnxruntime.Tensor("float32", landmarks, [1, landmarks.length / 3, 3]);
    const found = await session.run({ landmarks: input });
    return Object.fromEntries(Object.entries(found).map(([name, value]) => [name, value.data]));
  };
  return { near, far, points, graph };
}

/** One square picture in, all outputs out, the longest first. */
class Network {
  /** @param {CompiledModel} model */
  constructor(model) {
    this.model = model;
    this.shape = Array.from(model.getInputDetails()[0].shape);
    this.size = this.shape[1];
    this.lengths = model.getOutputDetails().map(({ shape }) => shape.reduce((a, b) => a * b, 1));
    this.order = this.lengths.map((_, n) => n).sort((a, b) => this.lengths[b] - this.lengths[a]);
    this.lengths.sort((a, b) => b - a);
  }

  async run(picture) {
    const input = new Tensor(picture, this.shape);
    try {
      const outputs = await this.model.run([input]);
      const values = this.order.map((n) => outputs[n].toTypedArray());
      for (const output of outputs) output.delete();
      return values;
    } finally {
      input.delete();
    }
  }
}
