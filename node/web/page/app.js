// Takes the event stream, judges its age, and shows it. Nothing here trusts that data arrive in time: see judge().
"use strict";

const kLate_ms = 300;        // older than this is STALE
const kDrift = 2e-4;         // of the two clocks, at most
const kSlow_ms = 500;        // a request that takes longer says nothing about the age of its answer
const kRetry_ms = 1000;       // between two requests
const kReconnect_ms = 5000;  // without a young frame or a part of the greeting, after which the page asks anew
const kMaxChanges = 200;

const kQualityWords = ["no value", "good", "uncertain", "bad"];
const kQualityMarks = ["✖", "●", "▲", "✖"];
const kResults = ["done", "unknown command", "no such sensor", "bad parameter", "not now: a sensor has no trustworthy value, or another command runs",
  "locked", "failed: a sensor lost its value", "timed out", "refused: the force moved; wait until it rests", "refused: a sensor is under load",
  "the zero cannot be stored", "adopted", "repeated"];

const byId = (id) => document.getElementById(id);
const put = (element, text) => { if (element.textContent !== text) element.textContent = text; };
const known = (v) => v !== null && v !== undefined;
const number = (v, digits, unit = "") => (known(v) ? v.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1") + unit : "–");

let hello = null, cards = [], frame = null, links = null;
let source = null, offset_ms = null, received_ms = -Infinity, asked_ms = -Infinity, well_ms = -Infinity, failure = "no data has arrived yet";
let is_stale = true, dirty = false, drawn_ms = 0;
const changes = new Map();
let token = sessionStorage.getItem("token") || "";

// ---- The stream ----

function connect() {
  if (source) source.close();
  offset_ms = null;
  asked_ms = performance.now();
  source = new EventSource("/api/stream");
  let greeted = false;
  source.addEventListener("hello", (e) => {
    const took_ms = performance.now() - asked_ms, next = JSON.parse(e.data);
    set_clock(next.t_s);
    greet(next);
    // The greeting may be as old as the whole request: the zero of the ages would be wrong by as much.
    if (!greeted && took_ms > kSlow_ms) end(`a request takes ${(took_ms / 1000).toFixed(1)} s: the server, the network or this browser is too slow`);
    greeted = true;
  });
  source.addEventListener("past", (e) => {
    const past = JSON.parse(e.data);
    cards[past.sensor].past.replace(past);
    well_ms = performance.now();  // the greeting is long, and the network may be slow
  });
  source.addEventListener("changes", (e) => { for (const change of JSON.parse(e.data)) changes.set(change.id, change); showChanges(); });
  source.addEventListener("message", (e) => take(JSON.parse(e.data)));
  source.addEventListener("error", () => end(source.readyState === EventSource.CLOSED ? "the server refuses this page: too many are open?" : "the server is gone"));
}

// Ends the connection; watch() makes the next one. The browser's own reconnection would not tell when it asked.
function end(why) {
  source.close();
  failure = why;
  offset_ms = null;
  judge();
}

// The zero of the ages: the shortest way of a message so far, which may grow as slowly as two clocks drift.
function set_clock(t_s) {
  const now_ms = performance.now(), late_ms = now_ms - t_s * 1000;
  offset_ms = offset_ms === null ? late_ms : Math.min(late_ms, offset_ms + kDrift * Math.max(0, now_ms - received_ms));
  received_ms = now_ms;
}

function take(next) {
  set_clock(next.t_s);
  frame = next;
  if (next.links) links = next.links;
  next.sensors.forEach((sensor, i) => { if (cards[i]) cards[i].past.add(next.t_s, sensor); });
  judge();
  if (!dirty) { dirty = true; requestAnimationFrame(show); }
}

// "" while the newest frame is young and the daemon lives; else why not. A timer calls it, so that a silence is noticed.
function why_stale() {
  if (!frame || offset_ms === null) return failure;
  const now_ms = performance.now(), age_ms = now_ms - offset_ms - frame.t_s * 1000;
  // Whole seconds, so that a screen reader can finish the sentence.
  if (age_ms > kLate_ms) return `the newest value is ${age_ms < 1000 ? "0.3" : Math.floor(age_ms / 1000)} s old or more: the server or the network does not respond`;
  well_ms = now_ms;
  return frame.alive ? "" : frame.why;
}

function judge() {
  const why = why_stale();
  put(byId("stale-why"), why);
  if (is_stale !== (why !== "")) {
    is_stale = why !== "";
    document.body.classList.toggle("stale", is_stale);
    if (is_stale) show();
  }
  const name = (hello && hello.node) || "tactiled";
  const title = is_stale ? `STALE – ${name}` : `${name} – tactiled`;
  if (document.title !== title) document.title = title;
}

function watch() {
  judge();
  const now_ms = performance.now(), closed = source.readyState === EventSource.CLOSED;
  if (now_ms - asked_ms < (closed ? kRetry_ms : kReconnect_ms) || (!closed && now_ms - well_ms < kReconnect_ms)) return;
  if (!closed) failure = why_stale();
  connect();
}
setInterval(watch, 50);
// Only maps that can be seen ask for arrays.
setInterval(() => {
  const now_ms = performance.now();
  if (!document.hidden) for (const card of cards) if (card.map && card.visible) card.map.update(now_ms);
}, 35);
// Timers of a hidden tab sleep: the first picture after it must be judged, too.
for (const event of ["visibilitychange", "resume"]) document.addEventListener(event, watch);

// ---- The page ----

function greet(next) {
  if (hello && hello.page !== next.page) location.reload();  // another version of the server has another page
  const same = hello && hello.run === next.run;
  hello = next;
  if (!same) changes.clear();
  frame = links = null;
  for (const card of cards) card.remove();
  cards = next.sensors.map((about, i) => new Card(about, i));
  put(byId("node"), next.node || "tactiled");
  byId("commands").hidden = !next.commands;
  unlock();
  show();
}

class Card {
  constructor(about, index) {
    this.about = about;
    this.past = new Past(about.components);
    const box = byId("sensor").content.cloneNode(true).firstElementChild;
    this.box = box;
    box.dataset.sensor = about.name;
    const find = (selector) => box.querySelector(selector);
    find("h3").textContent = about.name;
    this.quality = find(".quality");
    this.reasons = find(".reasons");
    this.strip = find(".strip");
    this.place = find(".place");
    this.reach_m = 0.01;
    this.map = about.taxels ? new HeatMap(find(".map"), about) : null;
    this.rows = new Map(this.past.seen.map((c) => [c, this.row(c, find(".rows"))]));
    const [force, torque] = box.querySelectorAll(".plot");
    this.plots = [new Plot(force, this.past, 0, "N"), new Plot(torque, this.past, 3, "Nm")];
    this.facts = Object.fromEntries([...box.querySelectorAll("[data-fact]")].map((e) => [e.dataset.fact, e]));
    put(this.facts.model, `${about.model}, ${about.method}${about.serial ? `, ${about.serial}` : ""}, link ${about.link}`);
    put(this.facts.damage, about.damage ? `${(100 * about.damage.mean).toFixed(1)} %, ${about.damage.kind.replace("_", " ")}` : "–");
    find(".buttons").hidden = !hello.commands;
    for (const button of box.querySelectorAll("button")) {
      button.dataset.sensor = about.name;
      button.setAttribute("aria-label", `${button.textContent} ${about.name}`);
    }
    this.visible = true;
    this.watch = new IntersectionObserver(([e]) => { this.visible = e.isIntersecting; if (this.map && !this.visible) this.map.hide(); });
    this.watch.observe(box);
    byId("sensors").append(box);
  }
  row(c, rows) {
    const unit = c < 3 ? "N" : "Nm", row = document.createElement("div");
    row.className = "row";
    row.innerHTML = '<span class="name"><svg width="22" height="8" aria-hidden="true"><line x1="0" y1="4" x2="22" y2="4" stroke-width="3"/></svg> <span></span></span><div class="bar" aria-hidden="true"><div class="fill"></div><div class="sd"></div></div><span class="number"><b></b> <small></small></span>';
    const line = row.querySelector("line");
    line.style.stroke = `var(--${"xyz"[c % 3]})`;
    if (kDashes[c % 3].length) line.style.strokeDasharray = kDashes[c % 3].join(" ");
    row.querySelector(".name > span").textContent = kNames[c];
    row.querySelector(".fill").style.background = `var(--${"xyz"[c % 3]})`;
    row.dataset.component = kNames[c];
    rows.append(row);
    return { value: row.querySelector("b"), sd: row.querySelector("small"), fill: row.querySelector(".fill"), band: row.querySelector(".sd"), unit, digits: c < 3 ? 3 : 4, scale: known(this.about.full_scale[c]) ? this.about.full_scale[c] : 0 };
  }
  show(s, draw) {
    const quality = s ? s.quality : 0;
    this.box.classList.toggle("good", quality === kGood);
    this.box.classList.toggle("uncertain", quality === kUncertain);
    this.box.classList.toggle("bad", quality !== kGood && quality !== kUncertain);
    const words = s ? hello.reasons.filter((_, bit) => s.reasons >> bit & 1) : [];
    put(this.quality, s ? `${kQualityMarks[quality]} ${kQualityWords[quality].toUpperCase()}` : "✖ STALE");
    put(this.reasons, s ? words.map((w) => hello.meanings[hello.reasons.indexOf(w)] || w).join("; ") : "no value: see above");
    for (const [c, row] of this.rows) {
      const value = s ? (c < 3 ? s.force_N[c] : s.torque_Nm[c - 3]) : null;
      const sd = s ? (c < 3 ? s.sd_force_N[c] : s.sd_torque_Nm[c - 3]) : null;
      put(row.value, number(value, row.digits));
      put(row.sd, known(value) ? (known(sd) ? `± ${number(sd, row.digits)} ${row.unit}` : `± ? ${row.unit}`) : row.unit);
      this.bar(row, value, sd);
    }
    put(this.facts.rate, number(s && s.rate_Hz, 1, " Hz"));
    put(this.facts.age, number(s && quality !== kBad ? s.age_ms : null, 0, " ms"));
    put(this.facts.bound, number(s && quality !== kBad ? s.age_bound_ms : null, 1, " ms"));
    put(this.facts.lost, s ? String(s.lost) : "–");
    put(this.facts.peak, number(s && s.peak_N, 2, " N"));
    put(this.facts.tares, s ? String(s.tares) : "–");
    put(this.facts.uncertainty, (s && s.uncertainty) || "–");
    put(this.facts.temperature, number(s && s.temperature_C, 1, " °C"));
    put(this.facts.touch, !s || quality === kBad ? "–" : s.state & 2 ? "OVERLOAD" : s.state & 1 ? "contact" : "none");
    if (draw && this.visible) this.draw(s);
    else if (this.map && this.visible && !s) this.map.show(null);
  }
  bar(row, value, sd) {
    if (!known(value)) { row.fill.style.width = row.band.style.width = "0"; row.band.style.minWidth = "0"; return; }
    row.scale = Math.max(row.scale, Math.abs(value), 1e-3);
    const at = (v) => 50 + 50 * Math.max(-1, Math.min(1, v / row.scale));
    row.fill.style.left = `${Math.min(50, at(value))}%`;
    row.fill.style.width = `${Math.abs(at(value) - 50)}%`;
    row.band.style.minWidth = known(sd) ? "" : "0";
    row.band.style.left = `${at(value - (sd || 0))}%`;
    row.band.style.width = `${at(value + (sd || 0)) - at(value - (sd || 0))}%`;
  }
  draw(s) {
    const now_s = frame ? frame.t_s : 0;
    for (const plot of this.plots) plot.draw(now_s);
    this.strip.setAttribute("aria-label", drawStrip(this.strip, this.past, now_s));
    if (this.map) return this.map.show(s);
    const cop = s ? s.cop_m : [null, null];
    if (this.place.hidden && known(cop[0]) && known(cop[1])) this.place.hidden = false;
    if (this.place.hidden) return;
    if (known(cop[0])) this.reach_m = Math.max(this.reach_m, Math.abs(cop[0]) * 1.1, Math.abs(cop[1]) * 1.1);
    drawPlace(this.place.firstElementChild, cop, this.reach_m);
    const text = `centre of pressure x ${number(known(cop[0]) ? cop[0] * 1000 : null, 1)} y ${number(known(cop[1]) ? cop[1] * 1000 : null, 1)} mm; the square is ${(this.reach_m * 2000).toFixed(0)} mm wide`;
    put(this.place.lastElementChild, text);
  }
  remove() {
    this.watch.disconnect();
    for (const plot of this.plots) plot.forget();
    this.box.remove();
  }
}

function show() {
  dirty = false;
  if (!hello) return;
  judge();
  const now_ms = performance.now(), draw = now_ms - drawn_ms > 95;
  if (draw) drawn_ms = now_ms;
  const live = is_stale ? null : frame;
  cards.forEach((card, i) => card.show(live ? live.sensors[i] : null, draw));
  showGrasp(live && live.grasp);
  showSummary(live);
  if (draw) showLinks(live);
}

function showSummary(f) {
  if (!f) {
    put(byId("flags"), "");
    return put(byId("summary"), `version ${hello.version || "–"}`);
  }
  const faults = hello.faults.filter((_, bit) => f.fault >> bit & 1), warnings = hello.warnings.filter((_, bit) => f.warning >> bit & 1);
  put(byId("flags"), [f.status & 1 << 9 ? "▲ SIMULATED" : "", f.status & 1 << 16 ? "▲ RT DEGRADED" : "", faults.length ? `✖ FAULT ${faults.join(", ")}` : "",
    warnings.length ? `▲ warning: ${warnings.join(", ")}` : ""].filter(Boolean).join(" · "));
  put(byId("summary"), [`version ${hello.version}`, `pid ${hello.pid}`, `heartbeat ${f.heartbeat}`, `worst cycle ${f.worst_cycle_us} µs`, `missed ${f.missed_cycles}`].join(" · "));
}

function showGrasp(g) {
  const mark = (quality) => (quality === "uncertain" ? ", uncertain" : "");
  const box = byId("grasp"), of = (key) => box.querySelector(`[data-grasp=${key}]`);
  if (g && g.state !== "unknown") box.hidden = false;
  if (box.hidden) return;
  put(of("state"), g ? g.state + mark(g.quality) : "–");
  put(of("weight"), g && known(g.weight_kg) ? `${number(g.weight_kg, 4)} ± ${number(g.weight_sd_kg, 4)} kg (${g.weight_state}${mark(g.weight_quality)})` : g ? `– (${g.weight_state})` : "–");
  put(of("object"), g ? (g.object_id ? `${g.object} (${number(g.probability * 100, 1)} %)` : "unknown") : "–");
  put(of("grip"), g ? `${number(g.grip_N, 2)} N, recommended ${number(g.recommended_N, 2)} N` : "–");
  put(of("friction"), g ? `${number(g.friction, 2)} ± ${number(g.friction_sd, 2)}` : "–");
  put(of("slips"), g ? [String(g.slips), ...g.jaws.map((jaw, i) => (jaw.slip === "unknown" ? "" : `${hello.sensors[i].name}: ${jaw.slip}${jaw.latched ? " (latched)" : ""}`))].filter(Boolean).join(" · ") : "–");
}

function showLinks(f) {
  const body = byId("links").tBodies[0];
  while (body.rows.length > hello.links.length) body.deleteRow(-1);
  hello.links.forEach((about, i) => {
    const row = body.rows[i] || body.insertRow();
    while (row.cells.length < 4) row.insertCell();
    const link = f && links && links[i];
    put(row.cells[0], about.name);
    put(row.cells[1], about.driver + (about.simulated ? ", simulated" : ""));
    put(row.cells[2], !link ? "–" : link.open ? "● open" : "✖ closed");
    put(row.cells[3], !link ? "–" : link.count.map((n, kind) => (n ? `${hello.link_counts[kind]} ${n}` : "")).filter(Boolean).join(", "));
  });
}

function showChanges() {
  const time = (ms) => new Date(ms).toLocaleTimeString();
  const newest = [...changes.values()].sort((a, b) => b.id - a.id);
  for (const old of newest.splice(kMaxChanges)) changes.delete(old.id);
  const rows = newest.map((change) => {
    const row = document.createElement("li"), when = document.createElement("time");
    when.textContent = time(change.wall_ms);
    when.dateTime = new Date(change.wall_ms).toISOString();
    const often = change.times > 1 ? ` (${change.times} times, last ${time(change.wall_ms + (change.last_t_s - change.t_s) * 1000)})` : "";
    row.append(when, `${["●", "▲", "✖"][change.severity]} ${change.subject}: ${change.text}${often}`);
    return row;
  });
  byId("changes").replaceChildren(...rows);
}

// ---- Commands ----

function unlock() {
  for (const button of document.querySelectorAll("button[data-command]")) button.disabled = token === "";
}

byId("token-form").addEventListener("submit", (e) => {
  e.preventDefault();
  token = byId("token").value.trim();
  sessionStorage.setItem("token", token);
  byId("token").value = "";
  put(byId("outcome"), token ? "Unlocked in this tab." : "Locked.");
  unlock();
});

document.addEventListener("click", async (e) => {
  const button = e.target.closest("button[data-command]");
  if (!button) return;
  const { command, sensor, weigh } = button.dataset, outcome = byId("outcome");
  const object = command === "teach" ? byId("object").value.trim() : undefined;
  const said = [command, sensor, weigh, object].filter(Boolean).join(" ");
  put(outcome, `${said}: asked …`);
  button.disabled = true;
  try {
    const answer = await fetch("/api/command", { method: "POST", headers: { "Content-Type": "application/json", Authorization: `Bearer ${token}` }, body: JSON.stringify({ command, sensor, weigh, object }) });
    const body = await answer.json();
    put(outcome, `${said}: ${body.error || body.why || kResults[body.result] || `result ${body.result}`}`);
    if (answer.status === 401) { token = ""; sessionStorage.removeItem("token"); }
  } catch (error) {
    put(outcome, `${said}: no answer, ${error.message}`);
  }
  unlock();
});

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  readColours();
  for (const card of cards) for (const plot of card.plots) plot.forget();
});

connect();
