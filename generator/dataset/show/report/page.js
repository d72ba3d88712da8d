"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const $ = (id) => document.getElementById(id);
  const SVG = "http://www.w3.org/2000/svg";
  // Viridis, a light-to-dark ramp for errors and a blue-to-orange one for signs: all three keep their
  // order for every kind of colour vision, and in grey.
  const FOUND = ["#440154", "#443983", "#31688e", "#21918c", "#35b779", "#90d743", "#fde725"];
  const ERROR = ["#fdf5ea", "#f9d3b0", "#f2a07a", "#df6553", "#b23058", "#71205f", "#2e1237"];
  const SIGNED = ["#0b4f8a", "#5b93c4", "#b9d2e6", "#f4f2ee", "#f1c9a5", "#d98a45", "#994a00"];

  function make(tag, options = {}, ...children) {
    const node = document.createElement(tag);
    for (const [key, value] of Object.entries(options)) {
      if (key === "text") node.textContent = value;
      else if (key === "class") node.className = value;
      else node.setAttribute(key, value);
    }
    node.append(...children);
    return node;
  }
  function shape(tag, options) {
    const node = document.createElementNS(SVG, tag);
    for (const [key, value] of Object.entries(options)) node.setAttribute(key, value);
    return node;
  }
  const percent = (share, digits = 1) => (100 * share).toFixed(digits) + "\u00a0%";
  const whole = (number) => number.toLocaleString("en-US");
  const images = (number) => `${whole(number)} ${number === 1 ? "image" : "images"}`;
  const degrees = (angle) => (angle > 0 ? "+" : angle < 0 ? "−" : "") + Math.abs(angle) + "°";
  const minus = (text) => text.replace("-", "−");
  function short(value) {
    const size = Math.abs(value);
    return minus(size < 9.95 ? value.toFixed(1) : value.toFixed(0)).replace(/^−(0|0\.0)$/, "$1");
  }

  function mix(stops, share) {
    const place = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
    const k = Math.min(Math.floor(place), stops.length - 2);
    const channel = (hex, i) => parseInt(hex.slice(1 + 2 * i, 3 + 2 * i), 16);
    return [0, 1, 2].map((i) =>
      Math.round(channel(stops[k], i) + (place - k) * (channel(stops[k + 1], i) - channel(stops[k], i))));
  }
  function paint(node, stops, share) {
    const rgb = mix(stops, share);
    const linear = rgb.map((c) => Math.pow(c / 255, 2.2));
    const light = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
    node.style.background = `rgb(${rgb.join(",")})`;
    node.style.color = light > 0.2 ? "#10161d" : "#ffffff";
  }
  function legend(node, stops, low, high) {
    const bar = make("i");
    bar.style.background = `linear-gradient(to right, ${stops.join(",")})`;
    node.replaceChildren(make("span", { text: low }), bar, make("span", { text: high }));
  }
  function rows(table, entries) {
    table.replaceChildren(...entries.map(([name, value]) =>
      make("tr", {}, make("th", { scope: "row", text: name }), make("td", { text: value }))));
  }

  // ---- sums over cells -------------------------------------------------
  const { yaw, pitch, roll } = data.axes;
  const state = { detector: 0, pick: 0, roll: 0, measure: "distance", region: 0 };
  const seen = () => data.detectors[state.detector];
  const cell = (i, j, k) => (i * pitch.length + j) * roll.length + k;
  const rollsShown = () => (state.roll === 0 ? roll.map((_, k) => k) : [state.roll - 1]);
  const cellsAt = (i, j) => rollsShown().map((k) => cell(i, j, k));
  const everyCell = () => yaw.flatMap((_, i) => pitch.flatMap((_, j) => cellsAt(i, j)));
  const sum = (values, cells) => cells.reduce((total, c) => total + values[c], 0);
  function mean(values, weights, cells) {
    const weight = sum(weights, cells);
    if (!weight) return null;
    return cells.reduce((total, c) => total + (weights[c] ? weights[c] * values[c] : 0), 0) / weight;
  }
  // Spread of the union: mean of squares minus square of the mean, along every axis that is given.
  function spread(sd, means, weights, cells) {
    const weight = sum(weights, cells);
    if (!weight) return null;
    const square = cells.reduce((total, c) => total + (weights[c]
      ? weights[c] * means.reduce((s, m) => s + m[c] * m[c], sd[c] * sd[c]) : 0), 0) / weight;
    const centre = means.reduce((s, m) => s + mean(m, weights, cells) ** 2, 0);
    return Math.sqrt(Math.max(0, square - centre));
  }
  const part = () => seen().maps[state.pick].regions[state.region];
  const map = () => seen().maps[state.pick];
  const AXES = ["yaw", "pitch", "roll"];
  const MEASURES = {
    distance: { name: "distance, px", unit: "\u00a0px", of: (c) => mean(part().distance, part().rows, c) },
    dx: { name: "shift to image right, px", unit: "\u00a0px", signed: true, of: (c) => mean(part().dx, part().rows, c) },
    dy: { name: "shift down, px", unit: "\u00a0px", signed: true, of: (c) => mean(part().dy, part().rows, c) },
    spread: { name: "spread about the mean shift, px", unit: "\u00a0px",
      of: (c) => spread(part().spread, [part().dx, part().dy], part().rows, c) },
    geodesic: { name: "pose error, degrees", unit: "°", pose: true, of: (c) => mean(map().geodesic, map().compared, c) },
  };
  AXES.forEach((name, a) => {
    MEASURES[name] = { name: `${name}: mean error, degrees`, unit: "°", pose: true, signed: true,
      of: (c) => mean(map().turn[a], map().compared, c) };
    MEASURES[`${name}_spread`] = { name: `${name}: spread, degrees`, unit: "°", pose: true,
      of: (c) => spread(map().turn_spread[a], [map().turn[a]], map().compared, c) };
  });

  // ---- maps ------------------------------------------------------------
  function drawMap(table, readout, value, label, stops, share, describe) {
    const previous = table.contains(document.activeElement) ? document.activeElement.dataset.at : null;
    table.classList.toggle("dense", yaw.length > 16);
    const lines = [];
    for (let j = pitch.length - 1; j >= 0; j--) {
      const line = make("tr", {}, make("th", { scope: "row", class: "side", text: degrees(pitch[j]) }));
      yaw.forEach((_, i) => {
        const cells = cellsAt(i, j);
        const number = value(cells);
        const td = make("td", { tabindex: lines.length || i ? -1 : 0, "data-at": `${i},${j}` });
        if (number === null) {
          td.className = "none";
        } else {
          td.textContent = label(number);
          td.dataset.value = number;
          paint(td, stops, share(number));
        }
        const say = () => { readout.textContent = describe(i, j, cells, number); };
        td.addEventListener("mouseenter", say);
        td.addEventListener("focus", say);
        line.append(td);
      });
      lines.push(line);
    }
    const heads = yaw.map((angle) => make("th", { scope: "col", text: degrees(angle) }));
    const foot = make("tr", {}, make("th", { class: "side" }), ...heads);
    const note = `yaw to the right, pitch upwards${data.binned ? "; cells of 10°" : ""}`;
    table.replaceChildren(make("caption", { text: note }), make("tbody", {}, ...lines, foot));
    if (previous) table.querySelector(`[data-at="${previous}"]`).focus();
  }
  function arrows(event) {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    const at = event.target.dataset.at;
    if (!step || !at) return;
    const [i, j] = at.split(",").map(Number);
    const next = event.currentTarget.querySelector(`[data-at="${i + step[0]},${j + step[1]}"]`);
    if (next) { next.focus(); event.preventDefault(); }
  }
  const where = (i, j) => `Yaw ${degrees(yaw[i])}, pitch ${degrees(pitch[j])}, ` +
    (state.roll ? `roll ${degrees(roll[state.roll - 1])}` : "all rolls");

  function drawDetection() {
    const m = map();
    const rate = (cells) => { const n = sum(m.rows, cells); return n ? sum(m.detected, cells) / n : null; };
    drawMap($("detection"), $("detection-readout"), rate, (r) => (100 * r).toFixed(0), FOUND, (r) => r,
      (i, j, cells, r) => `${where(i, j)}: ` + (r === null ? "no images"
        : `${whole(sum(m.detected, cells))} of ${whole(sum(m.rows, cells))} faces found, ${percent(r)}`));
    legend($("detection-legend"), FOUND, "0 %", "100 %");
    const all = everyCell();
    $("detection-readout").textContent = `${data.picks[state.pick]}, ` +
      (state.roll ? `roll ${degrees(roll[state.roll - 1])}` : "all rolls") +
      `: ${whole(sum(m.detected, all))} of ${whole(sum(m.rows, all))} faces found, ${percent(rate(all) ?? 0)}`;
  }

  function drawAtlas() {
    const measure = MEASURES[state.measure];
    $("region").disabled = Boolean(measure.pose);
    const values = yaw.flatMap((_, i) => pitch.map((_, j) => measure.of(cellsAt(i, j)))).filter((v) => v !== null);
    const top = Math.max(...values.map(Math.abs), 1e-9);
    const share = measure.signed ? (v) => 0.5 + v / (2 * top) : (v) => v / top;
    const say = (v) => (v === null ? "nothing to compare" : minus(v.toFixed(2)) + measure.unit);
    const counts = measure.pose ? map().compared : part().rows;
    drawMap($("atlas"), $("atlas-readout"), measure.of, short, measure.signed ? SIGNED : ERROR, share,
      (i, j, cells, v) => {
        const means = ["geodesic", ...AXES].map((key) => `${key === "geodesic" ? "pose error" : key} ${
          minus((MEASURES[key].of(cells) ?? NaN).toFixed(2))}°`);
        return `${where(i, j)}: ${measure.name.split(",")[0]} ${say(v)} (${images(sum(counts, cells))})` +
          (v === null ? "" : "; " + means.join(", "));
      });
    const end = top.toFixed(1) + measure.unit;
    legend($("atlas-legend"), measure.signed ? SIGNED : ERROR, measure.signed ? "−" + end : "0", end);
    const whom = measure.pose ? "" : `, ${data.regions[state.region]}`;
    $("atlas-readout").textContent =
      `${data.picks[state.pick]}${whom}, all cells shown: ${measure.name.split(",")[0]} ${say(measure.of(everyCell()))}`;
  }

  function drawRegions() {
    const cells = everyCell();
    const kept = state.region;
    const lines = data.regions.map((name, k) => {
      state.region = k;
      return [name, ...["distance", "dx", "dy", "spread"].map((key) => MEASURES[key].of(cells))];
    });
    state.region = kept;
    const top = Math.max(...lines.map((line) => line[1] ?? 0), 1e-9);
    const title = ["part", "", "distance", "right", "down", "spread"].map((text, k) =>
      make("th", { scope: "col", class: k > 1 ? "number" : "", text }));
    const body = lines.map(([name, ...values]) => {
      const bar = make("div", { class: "bar" }, make("b", { style: `width:${(100 * (values[0] ?? 0)) / top}%` }));
      return make("tr", { "data-region": name }, make("th", { scope: "row", text: name }),
        make("td", { class: "barcell" }, bar),
        ...values.map((v) => make("td", { class: "number", "data-value": v ?? "",
          text: v === null ? "–" : minus(v.toFixed(2)) })));
    });
    $("regions").replaceChildren(make("tr", {}, ...title), ...body);
  }

  function redraw() {
    $("roll-value").textContent = state.roll ? degrees(roll[state.roll - 1]) : "all rolls";
    $("roll").setAttribute("aria-valuetext", $("roll-value").textContent);
    drawDetection();
    if (data.why_no_atlas) return;
    drawAtlas();
    drawRegions();
    drawFace();
  }

  function setUpDetectors() {
    const several = data.detectors.length > 1;
    $("detector-label").hidden = $("detectors-card").hidden = !several;
    if (!several) return;
    data.detectors.forEach((one, k) => $("detector").append(make("option", { value: k, text: one.name })));
    $("detector").addEventListener("change", (e) => { state.detector = Number(e.target.value); redraw(); });
    const titles = ["detector", "faces found", "landmarks off by", "on the face", "pose off by"];
    const number = (value, unit, digits = 2) => make("td", { class: "number", "data-value": value ?? "",
      text: value === null ? "–" : value.toFixed(digits) + unit });
    $("detectors").replaceChildren(
      make("tr", {}, ...titles.map((text, k) => make("th", { scope: "col", class: k ? "number" : "", text }))),
      ...data.detectors.map((one) => make("tr", {}, make("th", { scope: "row", text: one.name }),
        number(data.rows ? 100 * one.detected / data.rows : 0, "\u00a0%", 1),
        number(one.overall.distance_px, "\u00a0px"), number(one.overall.distance_mm, "\u00a0mm"),
        number(one.overall.geodesic_deg, "°"))));
  }
  function setUpMaps() {
    setUpDetectors();
    data.picks.forEach((name, k) => $("pick").append(make("option", { value: k, text: name })));
    Object.entries(MEASURES).forEach(([key, m]) => $("measure").append(make("option", { value: key, text: m.name })));
    data.regions.forEach((name, k) => $("region").append(make("option", { value: k, text: name })));
    $("roll").max = roll.length > 1 ? roll.length : 0;
    $("roll").disabled = roll.length < 2;
    $("pick").addEventListener("change", (e) => { state.pick = Number(e.target.value); redraw(); });
    $("roll").addEventListener("input", (e) => { state.roll = Number(e.target.value); redraw(); });
    $("measure").addEventListener("change", (e) => { state.measure = e.target.value; redraw(); });
    $("region").addEventListener("change", (e) => { state.region = Number(e.target.value); redraw(); });
    $("detection").addEventListener("keydown", arrows);
    $("atlas").addEventListener("keydown", arrows);
    if (data.why_no_atlas) {
      $("atlas-card").remove(); $("regions-card").remove(); $("face").remove();
      document.querySelector('nav a[href="#face"]').remove();
      $("why").hidden = false;
      $("why").textContent = data.why_no_atlas;
    } else {
      $("regions-note").textContent = "Mean over the images chosen above, pixels: how far a detected landmark " +
        "lies from the same point anchored on the mesh, which way on average, and how much it scatters about that.";
    }
    redraw();
  }

  // ---- face ------------------------------------------------------------
  function drawFace() {
    const p = seen().points;
    const there = p.x.map((x, k) => (x === null ? -1 : k)).filter((k) => k >= 0);
    const xs = there.map((k) => p.x[k]), ys = there.map((k) => p.y[k]);
    const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const svg = $("facemap"), pad = 14;
    svg.setAttribute("viewBox", `${left - pad} ${top - pad} ${right - left + 2 * pad} ${bottom - top + 2 * pad}`);
    const sorted = there.map((k) => p.distance[k]).sort((a, b) => a - b);
    const high = Math.max(sorted[Math.floor(0.98 * (sorted.length - 1))], 1e-9);  // a few outliers hide the rest
    const longest = Math.max(...there.map((k) => Math.hypot(p.dx[k], p.dy[k])), 1e-9);
    const times = Math.max(1, Math.round(0.07 * (bottom - top) / longest));
    const lines = shape("g", { id: "shifts" }), dots = shape("g", {});
    for (const k of there) {
      lines.append(shape("line", { x1: p.x[k], y1: p.y[k], x2: p.x[k] + times * p.dx[k], y2: p.y[k] + times * p.dy[k] }));
      const dot = shape("circle", { cx: p.x[k], cy: p.y[k], r: 1.6, fill: `rgb(${mix(ERROR, p.distance[k] / high).join(",")})`,
        "data-point": k, "data-value": p.distance[k] });
      dot.addEventListener("mouseenter", () => {
        $("face-readout").textContent = `Landmark ${k}: distance ${p.distance[k].toFixed(2)} px; mean shift ` +
          minus(`${p.dx[k].toFixed(2)} right, `) + minus(`${p.dy[k].toFixed(2)} down, px in the head's frame`);
      });
      dots.append(dot);
    }
    svg.replaceChildren(lines, dots);
    $("shift-scale").textContent = String(times);
    $("face-readout").textContent = "";
    const shown = () => { lines.style.display = $("show-shift").checked ? "" : "none"; };
    $("show-shift").onchange = shown;
    shown();
    legend($("face-legend"), ERROR, "0", `${high.toFixed(1)} px and more`);
    $("face-note").textContent = `Mean distance of each landmark over the ${images(seen().overall.compared)} in which ` +
      "a face was found. The pose is undone, so a line is what the detector gets wrong in the same way however the " +
      "head turns. Image left is the subject's right.";
  }

  // ---- images ----------------------------------------------------------
  function setUpSheet() {
    const sheet = data.sheet;
    if (!sheet) {
      $("sheet-note").textContent = "Built with images = none, so there is nothing to show.";
      $("overlays").remove();
      return;
    }
    $("sheet-note").textContent = `${sheet.heads.length} of ${whole(data.heads_count)} heads, ${sheet.columns} of ` +
      `${whole(data.poses)} poses (yaw, pitch, roll${sheet.poses.length ? "" : "; every head has its own"}), with the outlines of eyes, brows, nose, mouth and face.`;
    const grid = $("sheet");
    grid.style.gridTemplateColumns = `minmax(74px, 110px) repeat(${sheet.columns}, 1fr)`;
    const titles = sheet.poses.length ? sheet.poses.map((pose) => pose.map(degrees).join(" ")) : Array(sheet.columns).fill("");
    grid.append(make("span"), ...titles.map((text) => make("span", { class: "pose", text })));
    const dots = (points, kind) => {
      const group = shape("g", { class: `dots-${kind}` });
      for (let k = 0; k < points.length; k += 2) group.append(shape("circle", { cx: points[k], cy: points[k + 1], r: 7 }));
      return group;
    };
    sheet.heads.forEach((head, h) => {
      grid.append(make("span", { class: "name", text: head.subject }, make("small", { text: head.expression })));
      sheet.tiles[h].forEach((tile) => {
        const box = make("figure", { class: "tile" });
        if (tile) {
          const svg = shape("svg", { viewBox: "0 0 1000 1000", "aria-hidden": "true" });
          svg.append(dots(tile.exact, "exact"), dots(tile.found, "found"));
          box.append(make("img", { src: tile.src, alt: `${head.subject} at ${tile.pose.map(degrees).join(", ")}` }), svg);
          if (!sheet.poses.length) box.title = tile.pose.map(degrees).join(" ");
          if (!tile.detected) box.append(make("figcaption", { class: "missed", text: "not detected" }));
        }
        grid.append(box);
      });
      for (let k = sheet.tiles[h].length; k < sheet.columns; k++) grid.append(make("span"));
    });
    for (const kind of ["exact", "found"]) {
      $(`show-${kind}`).addEventListener("change", (e) => grid.classList.toggle(`hide-${kind}`, !e.target.checked));
    }
  }

  // ---- variety ---------------------------------------------------------
  function setUpVariety() {
    const variety = data.variety;
    if (!variety) {
      $("variety").remove();
      document.querySelector('nav a[href="#variety"]').remove();
      return;
    }
    $("variety-note").textContent = `${variety.factors.length} settings are drawn, image by image or head by head. ` +
      "Bars: how often each value was drawn; blue: with the face found, grey: missed. Below them the quarters of the " +
      "distribution, or the choices: an image near the front, one in which the face was missed if there is one, and " +
      "the share of faces found. Everything else is drawn as well, so differences in a small dataset may be chance.";
    $("factors").append(...variety.factors.map(drawFactor));
  }
  function drawFactor(factor) {
    const unit = factor.unit ? ` ${factor.unit}` : "";
    const card = make("article", { class: "card factor", "data-factor": factor.name },
      make("h3", { text: factor.name, title: factor.help }),
      make("p", { class: "note" }, make("code", { text: factor.drawn }), `${unit}, for every ${factor.whose}`));
    card.append(histogram(factor.histogram, unit));
    const parts = make("div", { class: "parts" });
    factor.parts.names.forEach((name, k) => {
      const n = factor.parts.rows[k];
      if (!n) return;
      const share = factor.parts.found[k] / n;
      const tiles = make("div", { class: "tiles" });
      for (const sample of factor.examples[k]) {
        const tile = data.variety.tiles[sample];
        if (!tile) continue;
        const box = make("figure", { class: "tile", title: sample }, make("img", { src: tile.src, alt: sample }));
        if (!tile.detected) box.append(make("figcaption", { class: "missed", text: "missed" }));
        tiles.append(box);
      }
      const rate = make("div", { class: "rate", "data-part": name, "data-rows": n, "data-value": share,
        text: percent(share, 0) });
      rate.append(make("small", { text: ` of ${whole(n)}` }));
      paint(rate, FOUND, share);
      parts.append(make("div", {}, tiles, rate, make("div", { class: "under", text: name })));
    });
    card.append(parts);
    return card;
  }
  function histogram(bins, unit) {
    const most = Math.max(...bins.rows, 1), bars = make("div", { class: "bars" });
    bins.names.forEach((name, k) => {
      const say = `${name}${unit}: ${images(bins.rows[k])}, ${whole(bins.found[k])} with the face found`;
      bars.append(make("i", { title: say, "data-rows": bins.rows[k], style: `height:${(100 * bins.rows[k]) / most}%` },
        make("b", { style: `height:${bins.rows[k] ? (100 * bins.found[k]) / bins.rows[k] : 0}%` })));
    });
    return bars;
  }

  // ---- twins -----------------------------------------------------------
  const EFFECTS = ["found", "landmarks", "geodesic", "yaw", "pitch", "roll"];
  const EFFECT_NAMES = { found: "faces found", landmarks: "landmarks off", geodesic: "pose off",
    yaw: "yaw off", pitch: "pitch off", roll: "roll off" };
  function setUpTwins() {
    const twins = data.twins;
    if (!twins) {
      $("twins").remove();
      document.querySelector('nav a[href="#twins"]').remove();
      return;
    }
    $("twins-note").textContent = "Two images of the same head at the same pose, one without and one with the factor; " +
      "nothing else differs. Faces found: of all pairs. Landmarks (as a share of the distance between the outer eye " +
      "corners) and pose (the rigid fit of the reference face, against the exact rotation): of pairs in which both " +
      `faces were found. Intervals hold ${percent(twins.level, 0)} of ${whole(twins.resamples)} resamplings of the ` +
      "identities; where one leaves out zero, it is drawn in colour.";
    const reach = {};  // of each measure, over all factors: so bars may be compared
    for (const name of EFFECTS) {
      const ends = twins.factors.flatMap((one) => one.judged[0].effects.filter((e) => e.measure === name)
        .flatMap((e) => [e.change, e.low, e.high])).filter((value) => value !== null).map(Math.abs);
      reach[name] = Math.max(...ends, 1e-9);
    }
    $("effects").append(...twins.factors.map((one) => drawEffects(one, reach)));
  }
  function drawEffects(one, reach) {
    const detector = one.judged[0];
    const missed = detector.found_neither + detector.found_plain + detector.found_with;
    const said = [`${whole(one.pairs)} ${one.pairs === 1 ? "pair" : "pairs"} of ${whole(one.identities)} ` +
      (one.identities === 1 ? "identity" : "identities")];
    if (missed) said.push(`a face was missed in ${whole(missed)}: ${whole(detector.found_plain)} with it alone, ` +
      `${whole(detector.found_with)} without it alone, ${whole(detector.found_neither)} in both`);
    if (one.not_made) said.push(`${whole(one.not_made)} left out, since it could not be made for the head`);
    const card = make("article", { class: "card effect", "data-effect": one.factor },
      make("h3", { text: one.factor }), make("p", { class: "note", text: `${one.meaning[0].toUpperCase()}${one.meaning.slice(1)}. ${said.join("; ")}.` }));
    const tiles = make("div", { class: "twins" });
    for (const pair of one.examples) {
      const box = make("div", { class: "twin" });
      for (const [side, under] of [["plain", "without"], ["with", "with"]]) {
        const tile = make("figure", { class: "tile", title: pair[side].name },
          make("img", { src: pair[side].src, alt: pair[side].name }));
        tile.append(make("figcaption", { class: pair[side].found ? "" : "missed", text: under + (pair[side].found ? "" : ", missed") }));
        box.append(tile);
      }
      tiles.append(box);
    }
    const table = make("table", { class: "plain" });
    table.append(make("tr", {}, ...["", "without", "with", "change", ""].map((text) => make("th", { scope: "col", text }))));
    for (const name of EFFECTS) {
      const found = detector.effects.find((effect) => effect.measure === name);
      if (!found || found.change === null) continue;
      const interval = found.low === null ? "" : ` [${signed(found.low)}, ${signed(found.high)}]`;
      table.append(make("tr", { "data-measure": name, "data-change": found.change },
        make("th", { scope: "row", text: `${EFFECT_NAMES[name]}, ${found.unit}` }),
        make("td", { class: "number", text: found.plain.toFixed(2) }), make("td", { class: "number", text: found.with.toFixed(2) }),
        make("td", { class: "number", text: signed(found.change) + interval }),
        make("td", {}, range(found, reach[name]))));
    }
    card.append(tiles, table);
    return card;
  }
  const signed = (value) => (value > 0 ? "+" : "") + minus(value.toFixed(2));
  function range(found, reach) {
    const at = (value) => 50 + (50 * value) / reach;
    const sure = found.low !== null && (found.low > 0 || found.high < 0);
    const box = make("div", { class: sure ? "range sure" : "range" });
    if (found.low !== null) {
      box.append(make("i", { style: `left:${at(found.low)}%;width:${Math.max(at(found.high) - at(found.low), 1)}%` }));
    }
    box.append(make("b", { style: `left:${at(found.change)}%` }));
    return box;
  }

  // ---- the rest --------------------------------------------------------
  function setUpHeads() {
    const hidden = data.heads_count - data.publishable;
    $("licence-note").textContent = hidden
      ? `${whole(hidden)} of ${whole(data.heads_count)} heads may not be published: an export for publication refuses them.`
      : "The images of all heads may be published under their licences.";
    $("gallery").append(...data.heads.map((head) => {
      const text = make("div", {}, make("b", { text: head.subject }),
        make("p", { text: `${head.expression} · ${head.split} · ${head.source}` }),
        make("p", {}, make("span", { class: `badge ${head.redistributable ? "yes" : "no"}`,
          text: head.redistributable ? "✓ may be published" : "✕ not for publication" })),
        make("p", { text: head.license }),
        make("p", { text: `found in ${percent(head.rows ? head.detected / head.rows : 0)}` +
          (head.distance_px === null ? "" : `, off by ${head.distance_px.toFixed(2)} px`) }));
      const card = make("article", { class: "card head" },
        head.src ? make("img", { src: head.src, alt: `${head.subject}, front`, loading: "lazy" }) : make("span", { class: "blank" }), text);
      const more = [head.attribution, head.anchors ? `${head.anchors} landmarks anchored` +
        (head.anchor_residual_mm === null ? "" : `, residual ${head.anchor_residual_mm.toFixed(2)} mm`) : "no anchors",
        ...head.problems].filter(Boolean);
      card.append(make("p", { class: "wide", text: more.join(" · ") }));
      return card;
    }));
  }
  function setUpBuild() {
    const build = data.build;
    $("command").textContent = build.command || "not recorded";
    rows($("identity"), [["content digest", build.digest], ["configuration digest", build.configuration_digest],
      ["schema", build.schema_version], ["units that failed", whole(build.failures)],
      ["heads left out", build.skipped.length ? build.skipped.map((s) => Object.values(s).join(": ")).join("; ") : "none"]]);
    rows($("configuration"), build.configuration);
    rows($("versions"), Object.entries(build.versions));
    if (!build.timings) { $("time-note").textContent = "No build.log lies beside this dataset, so times are not known."; return; }
    $("time-note").textContent = "Seconds of all lanes together, a stage, of the units in build.log.";
    rows($("timings"), Object.entries(build.timings).sort((a, b) => b[1] - a[1]).map(([k, v]) => [k, v.toFixed(1) + " s"]));
  }
  function setUpTop() {
    const [first] = data.detectors, o = first.overall;
    $("title").textContent = `${images(data.rows)} of ${whole(data.heads_count)} ${data.heads_count === 1 ? "head" : "heads"}`;
    $("lead").textContent = "Rendered at poses that are known exactly. Where a detector found the face, its landmarks are " +
      "compared with the same points on the mesh: what remains is the detector's own error.";
    const figure = (name, value, under) => make("div", {}, make("dt", { text: name }),
      make("dd", { text: value }, make("div", { class: "under", text: under })));
    const figures = [
      figure("Images", whole(data.rows), `${whole(data.poses)} poses a head`),
      figure("Heads", whole(data.heads_count), `${whole(data.publishable)} may be published`),
      figure("Faces found", percent(data.rows ? first.detected / data.rows : 0), `${whole(data.rows - first.detected)} missed`),
    ];
    if (o.compared) {
      figures.push(figure("Landmarks off by", `${o.distance_px.toFixed(2)} px`, `${o.distance_mm.toFixed(2)} mm on the face`),
        figure("Pose off by", `${o.geodesic_deg.toFixed(2)}°`, "rigid fit, mean angle"));
    }
    $("figures").append(...figures);
  }

  setUpTop();
  setUpSheet();
  setUpMaps();
  setUpVariety();
  setUpTwins();
  setUpHeads();
  setUpBuild();
  document.documentElement.dataset.ready = "yes";
})();
