// The last 60 s of a sensor: its numbers, the plots of force and torque with their band, and the strip of its quality.
"use strict";

const kSpan_s = 60;
const kGap_s = 0.5;  // the plot has no line across a longer time without data
const kNames = ["fx", "fy", "fz", "mx", "my", "mz"];
const kDashes = [[], [8, 4], [2, 3]];
const kGood = 1, kUncertain = 2, kBad = 3;

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// Numbers of a column of the history: base64 of little-endian numbers.
function decode(text, Kind) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; ++i) bytes[i] = raw.charCodeAt(i);
  return Array.from(new Kind(bytes.buffer), (v) => (Number.isFinite(v) ? v : null));
}

class Past {
  constructor(components) {
    this.seen = [0, 1, 2, 3, 4, 5].filter((c) => components >> c & 1);
    this.t_s = [];
    this.quality = [];
    this.columns = this.seen.map(() => ({ value: [], low: [], high: [] }));
  }
  replace(past) {
    const t_s = decode(past.t_s, Float64Array), quality = decode(past.quality, Uint32Array);
    const columns = this.seen.map((_, n) => ({ value: decode(past.value[n], Float32Array), low: decode(past.low[n], Float32Array), high: decode(past.high[n], Float32Array) }));
    this.t_s = [];
    this.quality = [];
    this.columns = this.seen.map(() => ({ value: [], low: [], high: [] }));
    t_s.forEach((t, i) => this.push(t, quality[i], (n) => [columns[n].value[i], columns[n].low[i], columns[n].high[i]]));
  }
  // numbers(n): value, low and high of the seen component n.
  push(t_s, quality, numbers) {
    const last_s = this.t_s.at(-1);
    if (t_s - last_s > kGap_s) this.put(last_s + 1e-3, null, () => [null, null, null]);
    this.put(t_s, quality, numbers);
  }
  put(t_s, quality, numbers) {
    this.t_s.push(t_s);
    this.quality.push(quality);
    this.columns.forEach((column, n) => {
      const [value, low, high] = numbers(n);
      column.value.push(value);
      column.low.push(low);
      column.high.push(high);
    });
  }
  add(t_s, sensor) {
    if (this.t_s.length && t_s <= this.t_s[this.t_s.length - 1]) return;
    this.push(t_s, sensor.worst, (n) => {
      const c = this.seen[n];
      return [c < 3 ? sensor.force_N[c] : sensor.torque_Nm[c - 3], sensor.low[c], sensor.high[c]];
    });
    if (this.t_s[0] > t_s - kSpan_s - 5) return;
    let old = 0;
    while (this.t_s[old] < t_s - kSpan_s) ++old;
    for (const list of [this.t_s, this.quality, ...this.columns.flatMap((c) => [c.value, c.low, c.high])]) list.splice(0, old);
  }
  // [t_s, value, low, high, value, ...] of the seen components from `first` to before `end`.
  data(first, end) {
    const out = [this.t_s];
    this.seen.forEach((c, n) => { if (c >= first && c < end) out.push(this.columns[n].value, this.columns[n].low, this.columns[n].high); });
    return out;
  }
}

// One uPlot of components `first` .. `first + 2`.
class Plot {
  constructor(box, past, first, unit) {
    Object.assign(this, { box, past, first, unit, now_s: 0, plot: null });
    this.shown = past.seen.filter((c) => c >= first && c < first + 3);
    box.hidden = this.shown.length === 0;
  }
  make() {
    const series = [{}], bands = [];
    for (const c of this.shown) {
      const stroke = colour("xyz"[c % 3]), at = series.length;
      const bare = { stroke: "transparent", width: 1, points: { show: false } };
      series.push({ label: kNames[c], stroke, width: 1.5, dash: kDashes[c % 3], points: { show: false } }, { ...bare }, { ...bare });
      bands.push({ series: [at + 2, at + 1], fill: stroke + "38" });
    }
    const axis = { stroke: colour("faint"), grid: { stroke: colour("line"), width: 1 }, ticks: { stroke: colour("line") }, font: "12px system-ui" };
    this.plot = new uPlot({
      width: this.width(), height: 150, legend: { show: false }, cursor: { show: false }, series, bands,
      scales: { x: { time: false, range: () => [this.now_s - kSpan_s, this.now_s] }, y: { range: (_, low, high) => this.range(low, high) } },
      axes: [{ ...axis, size: 28, space: 60, splits: () => [-60, -45, -30, -15, 0].map((d) => this.now_s + d), values: () => ["-60 s", "-45", "-30", "-15", "now"] },
        { ...axis, size: 56, space: 28, label: this.unit, labelSize: 18, labelFont: "12px system-ui" }],
    }, this.past.data(this.first, this.first + 3), this.box);
  }
  width() { return Math.max(200, this.box.clientWidth); }
  range(low, high) {
    if (low === null || high === null) return [-1, 1];
    const room = Math.max((high - low) * 0.08, 1e-3);
    return [low - room, high + room];
  }
  draw(now_s) {
    if (this.box.hidden) return;
    this.now_s = now_s;
    if (!this.plot) this.make();
    if (this.plot.width !== this.width()) this.plot.setSize({ width: this.width(), height: 150 });
    this.plot.setData(this.past.data(this.first, this.first + 3));
  }
  forget() {
    if (this.plot) this.plot.destroy();
    this.plot = null;
  }
}

// Quality over time: height and pattern beside the colour. Low line: good. Half, slanted: uncertain. Full, solid: bad.
function drawStrip(canvas, past, now_s) {
  const width = Math.max(1, canvas.clientWidth);
  if (canvas.width !== width) canvas.width = width;
  const pen = canvas.getContext("2d"), seconds = [0, 0, 0, 0];
  pen.clearRect(0, 0, width, 16);
  const worst = new Uint8Array(width);
  for (let i = 0; i < past.t_s.length; ++i) {
    const x = Math.floor((past.t_s[i] - now_s + kSpan_s) / kSpan_s * width);
    if (past.quality[i] === null) continue;  // a time without data
    const quality = past.quality[i] || kBad;
    if (x >= 0 && x < width) worst[x] = Math.max(worst[x], quality);
    seconds[quality] += 1 / 30;
  }
  for (let x = 0; x < width; ++x) {
    const quality = worst[x] || (x > 0 && width > 900 ? worst[x - 1] : 0);
    if (quality === kGood) { pen.fillStyle = colour_good; pen.fillRect(x, 13, 1, 3); }
    if (quality === kUncertain) { pen.fillStyle = colour_uncertain; for (let y = 6 + x % 3; y < 16; y += 3) pen.fillRect(x, y, 1, 2); }
    if (quality === kBad) { pen.fillStyle = colour_bad; pen.fillRect(x, 0, 1, 16); }
  }
  return `quality in the last minute: good ${seconds[1].toFixed(0)} s, uncertain ${seconds[2].toFixed(0)} s, bad or no value ${seconds[3].toFixed(0)} s`;
}

let colour_good, colour_uncertain, colour_bad;
function readColours() {
  colour_good = colour("good");
  colour_uncertain = colour("uncertain");
  colour_bad = colour("bad");
}
readColours();

// The centre of pressure on the skin, seen from outside: x to the right, y up. `reach_m` is half of the side.
function drawPlace(canvas, cop_m, reach_m) {
  const pen = canvas.getContext("2d"), half = canvas.width / 2;
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.strokeStyle = colour("line");
  pen.strokeRect(0.5, 0.5, canvas.width - 1, canvas.height - 1);
  pen.beginPath();
  pen.moveTo(half, 0); pen.lineTo(half, canvas.height); pen.moveTo(0, half); pen.lineTo(canvas.width, half);
  pen.stroke();
  if (cop_m[0] === null || cop_m[1] === null) return;
  pen.fillStyle = colour("ink");
  pen.beginPath();
  pen.arc(half * (1 + cop_m[0] / reach_m), half * (1 - cop_m[1] / reach_m), 6, 0, 2 * Math.PI);
  pen.fill();
}
