// Heat maps of sensors with taxels: asks for places once and for forces several times a second, and draws the press.
"use strict";

const kArrayEach_ms = 140;    // between two requests for one sensor
const kArrayOld_ms = 500;     // an array that is older is not shown
const kArrayRetry_ms = 1000;  // after one that failed, in addition
const kArrayLimit_ms = 2000;  // for a request
const kMapHeight_px = 300, kSign_px = 10;
// What has no force: the mark is drawn over an empty cell.
const kStateMarks = { missing: "hatch", saturated: "solid", dead: "cross", frozen: "bars" };

class HeatMap {
  constructor(box, about) {
    Object.assign(this, { box, name: about.name, places: null, array: null, is_busy: false, asked_ms: -Infinity, scale_N: null, low_ms: 0, drawn: "" });
    box.hidden = false;
    this.canvas = box.querySelector("canvas");
    this.text = box.querySelector(".map-text");
    this.legend = box.querySelector(".map-legend");
  }
  async ask(path) {
    const answer = await fetch(`${path}?sensor=${encodeURIComponent(this.name)}`, { signal: AbortSignal.timeout(kArrayLimit_ms) });
    if (!answer.ok) throw new Error(String(answer.status));
    return answer.json();
  }
  // One request at a time; a failed one empties the map.
  async update(now_ms) {
    if (this.is_busy || now_ms - this.asked_ms < kArrayEach_ms) return;
    this.is_busy = true;
    this.asked_ms = now_ms;
    try {
      if (!this.places) this.setPlaces(await this.ask("/api/places"));
      const next = await this.ask("/api/array");
      if (next.epoch !== this.places.epoch) this.places = null;
      this.array = this.places && next;
      this.setScale(performance.now());
    } catch {
      this.array = null;
      this.asked_ms += kArrayRetry_ms;
    }
    this.is_busy = false;
  }
  setPlaces(places) {
    const { x_m, y_m, z_m } = places, box = { x0: Math.min(...x_m), x1: Math.max(...x_m), y0: Math.min(...y_m), y1: Math.max(...y_m) };
    const even = spacing(x_m, y_m);
    box.dx = places.columns > 1 ? (box.x1 - box.x0) / (places.columns - 1) : even;
    box.dy = places.rows > 1 ? (box.y1 - box.y0) / (places.rows - 1) : even;
    // The outermost taxels of a curved skin are drawn last.
    this.order = [...x_m.keys()].sort((a, b) => z_m[a] - z_m[b]);
    this.reach = box;
    this.places = places;
  }
  // A round number above the peak; a smaller one only after the peak was low for 3 s.
  setScale(now_ms) {
    const peak_N = this.array && this.array.peak_N;
    if (!(peak_N > 0)) return;
    const power = 10 ** Math.floor(Math.log10(peak_N)), nice = [1, 1.5, 2, 3, 5, 7, 10].map((m) => m * power).find((v) => v >= peak_N);
    if (this.scale_N !== null && nice < this.scale_N && now_ms - this.low_ms < 3000) return;
    if (nice === this.scale_N) this.low_ms = now_ms;
    if (nice !== this.scale_N) [this.scale_N, this.low_ms] = [nice, now_ms];
  }
  // The array, or null where it or the newest sample `s` has no value, or is old.
  live(s) {
    const a = this.array;
    if (!s || !a || offset_ms === null || performance.now() - offset_ms - a.t_s * 1000 > kArrayOld_ms) return null;
    return s.quality === kBad || s.quality === 0 || /^(bad|no-value)/.test(a.quality) ? null : a;
  }
  show(s) {
    const a = this.live(s), is_doubtful = a !== null && (s.quality === kUncertain || a.quality.startsWith("uncertain"));
    this.box.classList.toggle("empty", a === null);
    this.box.classList.toggle("doubtful", is_doubtful);
    const text = a ? describe(a, is_doubtful) : "✖ no values: the map is empty";
    put(this.text, text);
    this.canvas.setAttribute("aria-label", text);
    if (this.places) this.draw(a); else this.canvas.width = this.canvas.width;  // clears it
    this.showLegend(a);
  }
  // While it cannot be seen it asks for nothing, and so has nothing.
  hide() {
    this.array = null;
    this.show(null);
    put(this.text, "not in view");
  }
  draw(a) {
    const { x0, x1, y0, y1, dx, dy } = this.reach, wide = x1 - x0 + dx, high = y1 - y0 + dy;
    const room = Math.max(60, this.box.clientWidth), zoom = Math.min(room / wide, kMapHeight_px / high), dense = window.devicePixelRatio || 1;
    const width = Math.ceil(zoom * wide), height = Math.ceil(zoom * high);
    if (this.canvas.width !== width * dense || this.canvas.height !== height * dense) {
      Object.assign(this.canvas, { width: width * dense, height: height * dense });
      this.canvas.style.width = `${width}px`;
    }
    const pen = this.canvas.getContext("2d");
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    pen.clearRect(0, 0, width, height);
    const at = (x, y) => [(x - x0 + dx / 2) * zoom, (y1 - y + dy / 2) * zoom];
    const paint = colours(), cell = [dx * zoom, dy * zoom].map((side) => side - (side > 5 ? 1 : 0));
    const corner = (i, side) => at(this.places.x_m[i], this.places.y_m[i]).map((middle, n) => middle - side[n] / 2);
    const press_N = a && this.press(a);
    let ink = "";  // the canvas takes long to read a colour
    for (const i of this.order) {
      if (a && known(press_N[i])) {
        const next = paint.heat(this.scale_N === null ? 0 : press_N[i] / this.scale_N);
        if (ink !== next) pen.fillStyle = ink = next;
        pen.fillRect(...corner(i, cell), ...cell);
      } else if (!a && Math.min(...cell) > 5) {
        drawMark(pen, null, corner(i, cell), cell, paint);
      }
    }
    const sign = cell.map((side) => Math.max(side, kSign_px));  // above the neighbours, so that it can be seen
    if (a) for (const i of this.order) {
      const why = framedOf(a.state[i]);
      if (why) frame_of(pen, corner(i, cell), cell, paint[kFrames[why].ink]);
      if (stateOf(a.state[i])) drawMark(pen, stateOf(a.state[i]), corner(i, sign), sign, paint);
    }
    if (a && known(a.cop_S_m[0])) drawCentre(pen, at(a.cop_S_m[0], a.cop_S_m[1]), a.cop_sd_m.map((sd) => (sd || 0) * zoom), paint);
  }
  // Of each taxel along its normal, N; null without a force.
  press(a) {
    const parts = [..."xyz"].map((axis) => [a[`f${axis}_N`], this.places[`normal_${axis}`]]).filter(([force]) => force);
    return a.state.map((_, i) => (parts[0][0][i] === null ? null : parts.reduce((sum, [force, normal]) => sum - force[i] * normal[i], 0)));
  }
  showLegend(a) {
    const counts = new Map();
    const count = (name) => { if (name) counts.set(name, (counts.get(name) || 0) + 1); };
    if (a) for (const state of a.state) if (state) count(stateOf(state) || framedOf(state));
    const key = JSON.stringify([this.scale_N, [...counts], colour("paper")]);
    if (key === this.drawn) return;
    this.drawn = key;
    const scale = document.createElement("span"), paint = colours();
    scale.className = "map-scale";
    scale.innerHTML = "<span>0</span><canvas width=\"120\" height=\"12\" aria-hidden=\"true\"></canvas><span></span>";
    const pen = scale.querySelector("canvas").getContext("2d");
    for (let x = 0; x < 120; ++x) { pen.fillStyle = paint.heat(x / 119); pen.fillRect(x, 0, 1, 12); }
    scale.lastChild.textContent = this.scale_N === null ? "no press yet" : `${number(this.scale_N, digits(this.scale_N))} N`;
    const marks = [...counts].map(([name, n]) => {
      const entry = document.createElement("span"), sign = document.createElement("canvas");
      Object.assign(sign, { width: 14, height: 14 });
      const ink = sign.getContext("2d");
      const frame = kFrames[name];
      if (frame) frame_of(ink, [1, 1], [12, 12], paint[frame.ink]); else drawMark(ink, name, [1, 1], [12, 12], paint);
      entry.append(sign, ` ${frame ? frame.words : name} ${n}`);
      return entry;
    });
    this.legend.replaceChildren(scale, ...marks);
  }
}

// States of a taxel that has a force.
const kFrames = { doubted: { ink: "bad", words: "contradicts its neighbours" }, outside: { ink: "ink", words: "beyond its range" } };
const digits = (v) => Math.max(0, 1 - Math.floor(Math.log10(v)));
const stateOf = (bits) => hello.taxel_states.find((name, bit) => bits >> bit & 1 && !kFrames[name]);
const framedOf = (bits) => Object.keys(kFrames).find((name) => bits >> hello.taxel_states.indexOf(name) & 1);

// The median distance of a taxel to its nearest one in x and y.
function spacing(x_m, y_m) {
  const step = Math.ceil(x_m.length / 200), nearest = [];
  for (let i = 0; i < x_m.length; i += step) {
    let least = Infinity;
    for (let k = 0; k < x_m.length; ++k) if (k !== i) least = Math.min(least, Math.hypot(x_m[k] - x_m[i], y_m[k] - y_m[i]));
    nearest.push(least);
  }
  const middle = nearest.sort((a, b) => a - b)[nearest.length >> 1];
  return Number.isFinite(middle) && middle > 0 ? middle : 1e-3;
}

function describe(a, is_doubtful) {
  const mm = (v, sd) => `${number(v * 1000, 2)} ± ${known(sd) ? number(sd * 1000, 2) : "?"}`;
  const centre = known(a.cop_S_m[0]) ? `centre x ${mm(a.cop_S_m[0], a.cop_sd_m[0])}, y ${mm(a.cop_S_m[1], a.cop_sd_m[1])} mm` : "no centre of pressure";
  const area = known(a.area_m2) ? `area ${number(a.area_m2 * 1e6, 0)} ± ${known(a.area_sd_m2) ? number(a.area_sd_m2 * 1e6, 0) : "?"} mm²` : "";
  const peak = known(a.peak_N) ? `peak ${number(a.peak_N, 3)} ± ${number(a.peak_sd_N, 3)} N` : "";
  return [is_doubtful ? "▲ UNCERTAIN" : "", centre, area, peak].filter(Boolean).join("; ");
}

// Colours of the map in the page's present scheme. heat(part): from 0 to the end of the scale.
function colours() {
  const stops = [0, 1, 2, 3, 4].map((n) => colour(`heat${n}`).match(/[0-9a-f]{2}/g).map((v) => parseInt(v, 16)));
  const steps = Array.from({ length: 65 }, (_, n) => {
    const at = n / 16, low = Math.min(3, Math.floor(at));
    return `rgb(${stops[low].map((v, c) => Math.round(v + (stops[low + 1][c] - v) * (at - low))).join(",")})`;
  });
  const heat = (part) => steps[Math.round(Math.max(0, Math.min(1, part)) * 64)];
  return { heat, ink: colour("ink"), faint: colour("faint"), bad: colour("bad"), paper: colour("paper"), line: colour("line") };
}

function frame_of(pen, [x, y], [w, h], ink) {
  pen.strokeStyle = ink;
  pen.lineWidth = Math.max(1, w / 10);
  pen.strokeRect(x + pen.lineWidth / 2, y + pen.lineWidth / 2, w - pen.lineWidth, h - pen.lineWidth);
}

// A taxel without a force. name: its state; null: nothing is known of it.
function drawMark(pen, name, [x, y], [w, h], paint) {
  pen.save();
  pen.beginPath();
  pen.rect(x, y, w, h);
  pen.clip();
  pen.fillStyle = paint.paper;
  pen.fill();
  pen.strokeStyle = name ? paint.ink : paint.line;
  pen.lineWidth = 1;
  pen.strokeRect(x + 0.5, y + 0.5, w - 1, h - 1);
  pen.beginPath();
  const lines = { hatch: [-2, -1, 0, 1, 2].map((k) => [0, h + k * h / 2, w, k * h / 2]), cross: [[0, 0, w, h], [0, h, w, 0]], bars: [1, 2, 3].map((k) => [0, k * h / 4, w, k * h / 4]) };
  for (const [a, b, c, d] of lines[kStateMarks[name]] || []) { pen.moveTo(x + a, y + b); pen.lineTo(x + c, y + d); }
  pen.stroke();
  if (kStateMarks[name] === "solid") {
    pen.fillStyle = paint.bad;
    pen.fillRect(x + w * 0.15, y + h * 0.15, w * 0.7, h * 0.7);
  }
  pen.restore();
}

// The centre of pressure: a cross, and the ellipse of one standard uncertainty where it is large enough to be seen.
function drawCentre(pen, [x, y], [sd_x, sd_y], paint) {
  for (const [ink, width] of [[paint.paper, 5], [paint.ink, 2]]) {
    pen.strokeStyle = ink;
    pen.lineWidth = width;
    pen.beginPath();
    pen.moveTo(x - 9, y); pen.lineTo(x + 9, y); pen.moveTo(x, y - 9); pen.lineTo(x, y + 9);
    if (Math.max(sd_x, sd_y) > 3) { pen.moveTo(x + sd_x, y); pen.ellipse(x, y, sd_x, sd_y, 0, 0, 2 * Math.PI); }
    pen.stroke();
  }
}
