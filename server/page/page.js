// SPDX-License-Identifier: Apache-2.0
// Shows the newest snapshot of the server (snapshot.h), as long as it holds. What is not known, or
// no longer, is shown as unknown. Texts of the server become text nodes, never markup.
"use strict";

const COLOURS = {
  robot: [0, 114, 178], obstacle: [213, 94, 0], unknown: [86, 180, 233], error: [240, 228, 66],
  allowed: [204, 121, 167], ignored: [130, 130, 130],
};
const CELLS = { f: [247, 247, 247], o: [140, 140, 140], u: [86, 180, 233] };
const LOST_AFTER = 1.6;        // s without an event; the server sends one every 0.5 s
const HISTORY = 300;           // s
const CLOCK_EVERY = 1;         // s between questions for the server's clock
const CLOCK_DRIFT = 0.0005;    // s/s, more than clocks drift
const CLOCK_STEP = 0.1;        // s: a clock that differs by more was set, or its computer slept
const UNBOUND = { ahead: Infinity, at: 0, wall: 0 };
const MOST_TURNS = 20;         // of a path that is drawn

const $ = (id) => document.getElementById(id);
const replaying = $("replay") !== null;   // a recording (replay.js)
document.documentElement.className = replaying ? "replay" : "live";
let newest = null;             // snapshot that came
let snapshot = null;           // the one that is drawn, and judged
let scheduled = false;         // whether a drawing is
let stops = [];
let role = "";                 // of the page: what it may change
let source = null;             // of events: aborts them
let connected = false;
let refused = "";              // why the server sends no events
let broken = "";               // what broke a drawing off
let bound = UNBOUND;           // the server's clock was at most so much ahead of ours at a local time
let heardAt = 0;
let was = null;                // whether the last drawing was of something known
let choice = { x: 0, y: 1, at: {} };   // at: by joint, only what is not to follow the robot
const samples = [];            // one a second: {second, share (null: unknown), latency (null: not measured)}

const local = () => performance.now() / 1000;
const wall = () => Date.now() / 1000 - local();   // changes while our computer sleeps: local() may not
const text = (node, value) => { if (node.textContent !== value) node.textContent = value; };
const rgb = (colour) => `rgb(${colour.join()})`;

function element(tag, className, content, ...children) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (content) made.textContent = content;
  made.append(...children);
  return made;
}

// Replaces the children if what they are made of has changed: focus and scrolling stay.
function fill(node, data, make) {
  const key = JSON.stringify(data);
  if (node.dataset.key === key) return;
  node.dataset.key = key;
  node.replaceChildren(...make());
}

const seconds = (message) => message ? parseFloat(message) : NaN;   // "0.040s"
const duration = (s) => !Number.isFinite(s) ? "–" : s < 1 ? `${Math.round(s * 1000)} ms`
  : s < 120 ? `${s.toFixed(1)} s` : `${Math.round(s / 60)} min`;
const count = (n) => Number(n).toLocaleString("en").replaceAll(",", "\u202f");
const reason = (name) => name.replace(/^REASON_/, "").toLowerCase().replaceAll("_", " ");
const degrees = (v, digits = 1) => `${(v * 180 / Math.PI).toFixed(digits)}°`;
// "rad", "m", or "" if it is not known which of them.
const unitOf = (j) => snapshot.units[j];
// The value of a joint, by its place in the grid.
function value(v, j) {
  const unit = unitOf(j);
  return `${v.toFixed(3)} ${unit || "rad or m"}${unit === "rad" ? ` (${degrees(v)})` : ""}`;
}
const standsForAny = (joint) => joint.steps === 1 && joint.lower < joint.upper;   // its one value stands for any

function heard(event) {
  const { stops: all, role: granted, now } = JSON.parse(event);
  stops = all;
  role = granted;
  connected = true;
  heardAt = local();
  newest = now.error ? { ...newest, error: now.error } : { ...now, heardAt };
  if (now.clock - heardAt > ahead() + CLOCK_STEP) bound = UNBOUND;   // a clock has jumped
  sample(newest);
  schedule();
}

// Draws once before the browser paints, however many events there were.
function schedule() {
  if (scheduled) return;
  scheduled = true;
  requestAnimationFrame(async () => {
    await draw();
    scheduled = false;
    if (newest !== snapshot) schedule();
  });
}

// The most that the server's clock may be ahead of ours. Infinity: not known.
function ahead() {
  if (Math.abs(wall() - bound.wall) > CLOCK_STEP) return Infinity;
  return bound.ahead + CLOCK_DRIFT * (local() - bound.at);
}

// The server reads its clock after the question, so no connection is too slow for this bound.
async function followClock(opened) {
  while (opened === source) {
    const asked = { at: local(), wall: wall() };
    const clock = await fetch("clock", { cache: "no-store", signal: AbortSignal.timeout(5000) })
      .then((answer) => answer.json()).then((answer) => answer.clock).catch(() => NaN);
    if (opened === source && clock - asked.at < ahead()) bound = { ahead: clock - asked.at, ...asked };
    await new Promise((done) => { setTimeout(done, CLOCK_EVERY * 1000); });
  }
}

// Seconds since a snapshot was made, at most. Infinity: not known.
const since = (of = snapshot) => replaying ? 0 : Math.max(0, local() + ahead() - of.clock);
// The same, at least.
const sinceHeard = () => replaying ? 0 : local() - snapshot.heardAt;

// What the page may say now of a snapshot: {known, status}.
function judge(of = snapshot) {
  if (broken) return { known: false, status: broken };
  if (replaying) return judgeRecorded();
  if (refused) return { known: false, status: refused };
  if (of === null) return { known: false, status: connected ? "Waiting" : "Connecting" };
  if (!connected || local() - heardAt > LOST_AFTER) {
    return { known: false, status: "Connection lost: nothing here is current" };
  }
  if (of.error) return { known: false, status: `Unknown: ${of.error}` };
  if (since(of) === Infinity) return { known: false, status: "Connecting" };
  if (since(of) > LOST_AFTER) return { known: false, status: "Updates are late: nothing here is current" };
  if (of.blocked) return { known: false, status: `Not serving: ${of.blocked}` };
  if (since(of) >= of.valid_for) return { known: false, status: "Not serving: scene stale" };
  return { known: true, status: "Serving" };
}

// The slice that is chosen, as a query.
function slice() {
  const joints = snapshot && snapshot.database ? snapshot.database.grid.joints.length : 0;
  const at = [...Array(joints).keys()].map((j) => choice.at[j] ?? "").join();
  return `x=${choice.x}&y=${choice.y}&at=${at}`;
}

async function connect() {
  if (source) source.abort();
  source = document.hidden ? null : new AbortController();
  if (!source) return;
  const opened = source;
  followClock(opened);
  const why = await listen(opened.signal).catch(() => "");
  opened.abort();
  if (opened !== source) return;
  source = null;
  refused = why;
  lose();
  setTimeout(() => { if (!source) connect(); }, 500);
}

// Reads events as long as they come. Returns why the server refuses them, if it does.
async function listen(signal) {
  const answer = await fetch(`events?${slice()}`, { signal });
  if (!answer.ok) return (await answer.text()).trim();
  refused = "";
  const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return "";
    const events = (rest + value).split("\n\n");
    rest = events.pop();
    for (const event of events) heard(event.slice("data: ".length));
  }
}

// Another server may answer next.
function lose() {
  connected = false;
  bound = UNBOUND;
  draw();
}

// Masks.

function bits(mask) {
  const bytes = Uint8Array.from(atob(mask.bits), (c) => c.charCodeAt(0));
  return (x, y) => {
    if (x < 0 || y < 0 || x >= mask.width || y >= mask.height) return false;
    const i = y * mask.width + x;
    return (bytes[i >> 3] >> (i & 7) & 1) === 1;
  };
}

function veil(context, mask, colour, opacity) {
  if (!mask) return;
  const set = bits(mask);
  const pixels = new ImageData(mask.width, mask.height);
  for (let i = 0; i < mask.width * mask.height; ++i) {
    if (set(i % mask.width, Math.floor(i / mask.width))) pixels.data.set([...colour, opacity * 255], 4 * i);
  }
  stretch(context, pixels, 0, 0, context.canvas.width, context.canvas.height);
}

function stretch(context, pixels, x, y, width, height) {
  const small = new OffscreenCanvas(pixels.width, pixels.height);
  small.getContext("2d").putImageData(pixels, 0, 0);
  context.imageSmoothingEnabled = false;
  context.drawImage(small, x, y, width, height);
}

function outline(context, mask, strokes) {
  if (!mask) return;
  const set = bits(mask);
  const [w, h] = [context.canvas.width / mask.width, context.canvas.height / mask.height];
  context.beginPath();
  for (let y = 0; y <= mask.height; ++y) {
    for (let x = 0; x <= mask.width; ++x) {
      if (set(x, y) !== set(x, y - 1)) { context.moveTo(x * w, y * h); context.lineTo((x + 1) * w, y * h); }
      if (set(x, y) !== set(x - 1, y)) { context.moveTo(x * w, y * h); context.lineTo(x * w, (y + 1) * h); }
    }
  }
  for (const [colour, width, dash] of strokes) {
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.setLineDash(dash || []);
    context.stroke();
  }
  context.setLineDash([]);
}

// Views.

async function drawViews(shown) {
  const { views, database } = shown;
  const figures = $("views");
  fill(figures, database.views.map((view) => view.name), () => database.views.map((view) => {
    const canvas = document.createElement("canvas");
    canvas.width = 480;
    canvas.height = Math.round(480 * view.image_height / view.image_width);
    canvas.setAttribute("role", "img");
    const figure = element("figure", "", "", canvas, element("p", "veil"), element("figcaption"));
    figure.dataset.view = view.name;
    return figure;
  }));
  const images = await Promise.all(database.views.map((view) => decode(views[view.name].image)));
  if (shown === snapshot) {   // otherwise a newer one is drawn already
    const { known } = judge();
    database.views.forEach((view, i) => drawView(figures.children[i], view.name, images[i], shown, known));
  }
  for (const image of images) if (image) image.close();
}

function drawView(figure, name, image, { views, scene, paths }, known) {
  const [canvas, missing, caption] = figure.children;
  const context = canvas.getContext("2d");
  const seen = scene ? scene.views.find((of) => of.view === name) : null;
  const beside = views[name];
  context.clearRect(0, 0, canvas.width, canvas.height);
  if (image) {
    context.imageSmoothingEnabled = true;
    context.drawImage(image, 0, 0, canvas.width, canvas.height);
  }
  const opacity = image ? 0.55 : 0.9;
  const words = [];
  if (seen) {
    for (const plane of ["unknown", "ignored", "error", "obstacle"]) veil(context, seen[plane], COLOURS[plane], opacity);
    veil(context, beside.allowed, COLOURS.allowed, opacity);
    outline(context, beside.robot, [["#fff", 4], [rgb(COLOURS.robot), 2.5]]);
    words.push(`obstacle ${seen.obstacle_pixels}`, `unknown ${seen.unknown_pixels}`, `error ${seen.error_pixels}`);
    for (const path of known ? paths : []) {
      if (path.state !== "occupied" || !path.why) continue;
      outline(context, path.why[name].robot, [["#fff", 2.5], [rgb(COLOURS.robot), 1.5, [5, 4]]]);
      outline(context, path.why[name].convicts, [["#fff", 5], ["#000", 2.5]]);
    }
  }
  text(missing, !seen ? "This view is not in the scene: it counts as an obstacle everywhere"
    : known ? "" : "Not current");
  const line = seen ? `${words.join(", ")} pixels` : "missing";
  caption.replaceChildren(element("b", seen ? "" : "no", name), ` ${line}`);
  canvas.setAttribute("aria-label", `View ${name}: ${line}`);
}

async function decode(base64) {
  if (!base64) return null;
  const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  return createImageBitmap(new Blob([bytes], { type: "image/jpeg" })).catch(() => null);
}

// The configuration space.

const MARGIN = { left: 64, right: 12, top: 10, bottom: 46 };

function drawMap(shown, known) {
  const { space, database, present, paths } = shown;
  const joints = database.grid.joints;
  const flat = space.x === space.y;
  const [jx, jy] = [joints[space.x], joints[space.y]];
  const rows = flat ? 1 : jy.steps;
  const canvas = $("map");
  const wide = Math.max(200, Math.round(canvas.clientWidth));
  const inner = wide - MARGIN.left - MARGIN.right;
  const high = flat ? 48 : Math.min(Math.round(inner * 1.0), Math.max(Math.round(inner * 0.5), Math.round(inner * rows / jx.steps)));
  const context = scaled(canvas, wide, high + MARGIN.top + MARGIN.bottom);
  context.save();
  context.translate(MARGIN.left, MARGIN.top);
  if (known && space.cells) {
    const pixels = new ImageData(jx.steps, rows);
    for (let i = 0; i < jx.steps * rows; ++i) {
      const [column, row] = [i % jx.steps, Math.floor(i / jx.steps)];
      pixels.data.set([...CELLS[space.cells[i]], 255], 4 * ((rows - 1 - row) * jx.steps + column));
    }
    stretch(context, pixels, 0, 0, inner, high);
  } else {   // the server sends no cells of a slice with very many
    context.fillStyle = rgb(CELLS.u);
    context.fillRect(0, 0, inner, high);
  }
  context.strokeStyle = "#555";
  context.lineWidth = 1;
  context.strokeRect(0, 0, inner, high);
  // A value of a joint lies in the middle of its cell.
  const step = (joint) => (joint.upper - joint.lower) / Math.max(1, joint.continuous ? joint.steps : joint.steps - 1);
  const px = (v) => ((v - jx.lower) / (step(jx) || 1) + 0.5) / jx.steps * inner;
  const py = (v) => flat ? high / 2 : high - ((v - jy.lower) / (step(jy) || 1) + 0.5) / rows * high;
  // A continuous joint's value may be whole turns beyond the map.
  const turnOf = (joint, v) => joint.continuous ? Math.floor((v - joint.lower) / (joint.upper - joint.lower) + 0.5 / joint.steps) : 0;
  const back = (joint, v, turn = turnOf(joint, v)) => turn ? v - turn * (joint.upper - joint.lower) : v;
  const place = (q) => [px(back(jx, q[space.x])), py(back(jy, q[space.y]))];
  ticks(context, space, joints, px, py, inner, high);
  context.beginPath();
  context.rect(0, 0, inner, high);
  context.clip();
  for (const path of paths) {
    context.beginPath();
    const turns = (joint, j) => {
      const of = path.waypoints.map((q) => turnOf(joint, q[j]));
      const least = Math.min(...of);
      const many = Math.max(...of) - least + 1;
      return many > MOST_TURNS ? [] : Array.from({ length: many }, (_, i) => least + i);
    };
    // Once for each turn that it touches: the clipped copies join at the map's borders.
    for (const tx of turns(jx, space.x)) {
      for (const ty of turns(jy, space.y)) {
        path.waypoints.forEach((q, i) => context[i ? "lineTo" : "moveTo"](px(back(jx, q[space.x], tx)), py(back(jy, q[space.y], ty))));
      }
    }
    for (const [colour, width] of [["#fff", 5], [rgb(COLOURS.robot), 2.5]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.stroke();
    }
    const q = path.check && path.check.configuration ? path.check.configuration.positions : [];
    if (!known || path.state !== "occupied" || q.length !== joints.length) continue;
    cross(context, ...place(q));
  }
  context.restore();
  if (present) {
    const [x, y] = place(present.configuration);
    ring(context, MARGIN.left + x, MARGIN.top + y);
  }
  const any = joints.filter(standsForAny).map((joint) => joint.name).join(", ");
  text($("cells-note"), any && `A cell is free, or occupied, whatever these joints do: ${any}. Otherwise it is unknown.`);
  text($("map-missing"), known ? space.missing : judge().status);
  const where = present ? present.configuration.map((v, j) => `${joints[j].name} ${value(v, j)}`).join(", ") : "";
  const state = known && present ? present.state : "unknown";
  text($("present"), present ? `The robot is at ${where}: ${state}.` : "Where the robot is, is not known.");
  canvas.setAttribute("aria-label", `Map over ${jx.name}${flat ? "" : ` and ${jy.name}`}. ${$("present").textContent}`);
  for (const name of ["free", "occupied", "unknown"]) {
    text($(name), known && space.counts ? `${count(space.counts[name])} (${percent(space.counts, name)} %)` : "–");
  }
}

function percent(counts, name) {
  return (100 * counts[name] / (counts.free + counts.occupied + counts.unknown)).toFixed(1);
}

function scaled(canvas, width, height) {
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  canvas.style.height = `${height}px`;
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  context.font = "12px system-ui, 'DejaVu Sans', sans-serif";
  return context;
}

function ticks(context, { x, y }, joints, px, py, width, height) {
  context.fillStyle = "#222";
  context.textBaseline = "top";
  const at = (joint, part) => joint.lower + part * (joint.upper - joint.lower);
  const label = (j) => `${joints[j].name}, ${unitOf(j) || "rad or m"}`;
  const turns = (j) => unitOf(j) === "rad";
  context.textAlign = "center";
  for (const part of [0, 0.5, 1]) {
    const v = at(joints[x], part);
    const words = v.toFixed(2) + (turns(x) ? ` (${degrees(v, 0)})` : "");
    const half = context.measureText(words).width / 2;
    context.fillText(words, Math.min(width - half, Math.max(half, px(v))), height + 6);
  }
  context.fillText(label(x), width / 2, height + 24);
  if (x === y) return;
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const part of [0, 0.5, 1]) {
    const v = at(joints[y], part);
    const lines = turns(y) ? [v.toFixed(2), degrees(v, 0)] : [v.toFixed(2)];
    const half = 7 * lines.length;
    const middle = Math.min(height - half, Math.max(half, py(v)));
    lines.forEach((line, i) => context.fillText(line, -6, middle + 14 * (i - (lines.length - 1) / 2)));
  }
  context.save();
  context.translate(-MARGIN.left + 6, height / 2);
  context.rotate(-Math.PI / 2);
  context.textAlign = "center";
  context.textBaseline = "top";
  context.fillText(label(y), 0, 0);
  context.restore();
}

function ring(context, x, y) {
  for (const [colour, width] of [["#fff", 7], ["#000", 3]]) {
    context.beginPath();
    context.arc(x, y, 8, 0, 2 * Math.PI);
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
  }
}

function cross(context, x, y) {
  for (const [colour, width] of [["#fff", 7], [rgb(COLOURS.obstacle), 4]]) {
    context.beginPath();
    for (const d of [-1, 1]) { context.moveTo(x - 8, y - 8 * d); context.lineTo(x + 8, y + 8 * d); }
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
  }
}

// With more than two joints: which are the axes, and where the others are.
function drawControls(shown) {
  const { database: { grid: { joints } }, space } = shown;
  fill($("controls"), [joints, space.x, space.y], () => {
    if (joints.length < 3) return [];
    const axis = (name, chosen) => {
      const select = document.createElement("select");
      joints.forEach((joint, j) => {
        if (!standsForAny(joint) || j === chosen) select.append(new Option(joint.name, j, false, j === chosen));
      });
      select.onchange = () => choose({ [name]: Number(select.value) });
      return element("label", "", name === "x" ? "Across" : "Up", select);
    };
    const slider = (joint, j) => {
      if (standsForAny(joint)) return element("span", "", `${joint.name}: any`);
      const range = document.createElement("input");
      Object.assign(range, { type: "range", min: 0, max: joint.steps - 1 });
      range.dataset.joint = j;
      range.oninput = () => choose({ at: { ...choice.at, [j]: Number(range.value) } });
      return element("label", "", joint.name, range, element("output"));
    };
    const follow = document.createElement("input");
    follow.type = "checkbox";
    follow.id = "follow";
    follow.onchange = () => choose({ at: follow.checked ? {}
      : Object.fromEntries(snapshot.space.at.map((step, j) => [j, step])) });
    return [axis("x", space.x), axis("y", space.y),
      ...joints.flatMap((joint, j) => j === space.x || j === space.y ? [] : [slider(joint, j)]),
      element("label", "", "", follow, "through the robot")];
  });
  if (joints.length < 3) return;
  $("follow").checked = Object.keys(choice.at).length === 0;
  for (const range of $("controls").querySelectorAll("input[type=range]")) {
    const j = Number(range.dataset.joint);
    const joint = joints[j];
    if (document.activeElement !== range || $("follow").checked) range.value = space.at[j];
    const step = (joint.upper - joint.lower) / Math.max(1, joint.continuous ? joint.steps : joint.steps - 1);
    text(range.nextSibling, value(joint.lower + step * range.value, j));
  }
}

let chosen = 0;
function choose(change) {
  choice = { ...choice, ...change };
  if (choice.x === choice.y) choice = "x" in change ? { ...choice, y: snapshot.space.x } : { ...choice, x: snapshot.space.y };
  clearTimeout(chosen);
  chosen = setTimeout(replaying ? show : connect, 150);
}

// Lists.

function drawPaths(shown, known) {
  const shownPaths = shown.paths.map((path) => ({
    client: path.client, waypoints: path.waypoint_count, check: path.check,
    state: known && snapshot.clock + since() < path.valid_until ? path.state : "unknown",
  }));
  fill($("paths"), [shownPaths, shown.path_count, known], () => {
    if (shown.path_count === 0) return [element("li", "quiet", "No client watches a path.")];
    const items = shownPaths.map((path) => {
      const item = element("li", path.state, "", element("span", "verdict", path.state),
        ` ${path.waypoints} waypoints, watched by ${path.client}`);
      const { check, state } = path;
      if (!check) return item;
      if (state === "unknown") {
        const why = shown.blocked || reason(check.verdict.reason);
        item.append(element("p", "", known && why !== "unspecified" ? `Reason: ${why}` : "Not current"));
      }
      if (state === "occupied") {
        const joints = shown.database.grid.joints;
        const q = check.configuration.positions.map((v, j) => `${joints[j].name} ${value(v, j)}`).join(", ");
        item.append(element("p", "", `First blocked ${Math.round(check.fraction * 100)} % after waypoint ${check.segment}: ${q}`));
        item.append(element("p", "", check.verdict.views.map((view) => view.missing ? `${view.view}: missing`
          : `${view.view}: ${view.obstacle_pixels} obstacle`).join(", ") + " pixels. Dashed in the views: the robot there."));
      }
      item.append(element("p", "quiet", `Verdict of scene ${check.basis.scene_id}`));
      return item;
    });
    const more = shown.path_count - shown.paths.length;
    return more > 0 ? [...items, element("li", "quiet", `and ${more} more`)] : items;
  });
}

function drawDevices(shown) {
  const live = shown.acquisition;
  const rows = live ? [
    ...live.cameras.map((camera) => [camera.view, camera.serving, camera.fault, camera.last_image_age, camera.images, camera.errors]),
    ["robot", live.robot.serving, live.robot.fault, live.robot.last_sample_age, live.robot.samples, live.robot.errors],
  ] : shown.database.views.map((view) => {
    const seen = shown.scene && shown.scene.views.some((of) => of.view === view.name);
    return [view.name, seen, seen ? "" : "not in the scene", null, "–", "–"];
  });
  fill($("devices"), rows, () => rows.map(([name, serving, fault, age, good, errors]) => {
    const row = element("tr", "", "", element("th", "", name),
      element("td", serving ? "yes" : "no", serving ? (live ? "serving" : "in the scene") : fault || "not serving"));
    row.firstChild.scope = "row";
    for (const cell of [duration(seconds(age)), good, errors]) row.append(element("td", "", String(cell)));
    return row;
  }));
}

function drawStops() {
  const today = new Date().toDateString();
  fill($("stops"), [today, stops], () => stops.length === 0 ? [element("li", "note", "None since the server started.")]
    : stops.map((stop) => {
      const time = new Date(stop.time);
      const dateStyle = time.toDateString() === today ? undefined : "medium";
      const shown = element("b", "", time.toLocaleString("en-GB", { dateStyle, timeStyle: "medium" }));
      return element("li", "", "", shown, stop.reason ? `${stop.reason}: ${stop.message}` : "serving again");
    }));
}

// Charts.

function sample(now) {
  const { known } = judge(now);
  const counts = now.space && now.space.counts;
  const second = Math.floor(local());
  const taken = { second, latency: now.latency, share: known && counts ? counts.occupied / (counts.free + counts.occupied + counts.unknown) : null };
  const last = samples.at(-1);
  if (last && last.second === second) {
    if (taken.share === null) last.share = null;  // a second with a stop is a stop
    return;
  }
  samples.push(taken);
  while (samples[0].second < second - HISTORY) samples.shift();
}

function drawHistory() {
  const canvas = $("history");
  const none = snapshot && snapshot.space && !snapshot.space.counted;
  canvas.hidden = none;
  text($("history-note"), none ? "Not measured: no map of the whole space is made while robot images are drawn. "
    + "'silhouette-capture draw' stores them."
    : "Occupied share of the configuration space, since this page was opened. Striped: unknown.");
  if (none) return;
  const [left, high, bottom] = [40, 110, 20];
  const wide = Math.max(200, canvas.clientWidth);
  const context = scaled(canvas, wide, high + bottom);
  const end = Math.floor(local());
  const x = (second) => left + (wide - left - 4) * (1 - (end - second) / HISTORY);
  const most = Math.max(0.05, ...samples.map((one) => one.share ?? 0)) * 1.2;
  const y = (share) => high - (high - 8) * Math.min(1, share / Math.min(1, most));
  const each = (wide - left - 4) / HISTORY;
  const by = new Map(samples.map((one) => [one.second, one.share]));
  context.strokeStyle = rgb(CELLS.u);
  context.lineWidth = 1.5;
  for (let second = samples.length ? samples[0].second : end; second <= end; ++second) {
    if ((by.get(second) ?? null) !== null || second === end) continue;
    context.save();
    context.beginPath();
    context.rect(x(second), 8, each + 0.5, high - 8);
    context.clip();
    context.beginPath();
    for (let s = -high; s < wide; s += 7) { context.moveTo(s, high); context.lineTo(s + high, 0); }
    context.stroke();
    context.restore();
  }
  context.fillStyle = "#6a6a6a";
  for (const { second, share } of samples) {
    if (share !== null) context.fillRect(x(second), y(share), each + 0.5, high - y(share));
  }
  context.strokeStyle = "#555";
  context.lineWidth = 1;
  context.strokeRect(left, 8, wide - left - 4, high - 8);
  context.fillStyle = "#222";
  context.textBaseline = "middle";
  context.textAlign = "right";
  context.fillText(`${(100 * Math.min(1, most)).toFixed(0)} %`, left - 5, 14);
  context.fillText("0", left - 5, high - 6);
  context.textBaseline = "top";
  context.fillText("now", wide - 4, high + 5);
  context.textAlign = "left";
  context.fillText("5 min ago", left, high + 5);
  const newest = samples.at(-1);
  canvas.setAttribute("aria-label", newest && newest.share !== null
    ? `Occupied share, now ${(100 * newest.share).toFixed(1)} percent` : "Occupied share: unknown now");
}

const latencyKind = (latency) => latency.to_map.count > 0 ? "to_map" : "to_scene";

// Scenes of the last minute, or as long as the page has looked: how many each bar has.
function latencyBars(latency) {
  const kind = latencyKind(latency);
  const now = latency[kind];
  const before = samples.find((one) => one.latency && one.second >= local() - 60)?.latency[kind];
  const first = before && before.count <= now.count ? before : { within: now.within.map(() => 0), count: 0 };
  const sums = [...now.within.map((n, i) => n - first.within[i]), now.count - first.count];
  return sums.map((n, i) => n - (i ? sums[i - 1] : 0));
}

function drawLatency(shown) {
  const canvas = $("latency");
  canvas.hidden = !shown.latency;
  if (!shown.latency) {
    text($("latency-text"), "Not measured: clients take the images. It is with --live.");
    return;
  }
  const kind = latencyKind(shown.latency);
  const bars = latencyBars(shown.latency);
  const wide = Math.max(200, canvas.clientWidth);
  const high = 100;
  const context = scaled(canvas, wide, high + 22);
  const each = wide / bars.length;
  const most = Math.max(1, ...bars);
  context.textAlign = "center";
  bars.forEach((n, i) => {
    const h = (high - 16) * n / most;
    context.fillStyle = rgb(COLOURS.robot);
    context.fillRect(i * each + 2, high - h, each - 4, h);
    context.fillStyle = "#222";
    context.textBaseline = "bottom";
    if (n > 0) context.fillText(n, (i + 0.5) * each, high - h - 1);
    context.textBaseline = "top";
    const bound = i < shown.latency.bounds.length ? `${+(shown.latency.bounds[i] * 1000).toFixed(1)}` : "more";
    context.fillText(bound, (i + 0.5) * each, high + 6);
  });
  context.fillStyle = "#555";
  context.fillRect(0, high, wide, 1);
  const what = kind === "to_map" ? "map" : "scene";
  text($("latency-text"), `Scenes of the last minute by the time from the last pixel to the ${what}, in ms (upper bounds). `
    + `Median since the start: ${duration(seconds(shown.acquisition[kind].median))}, 99 of 100 within ${duration(seconds(shown.acquisition[kind].p99))}.`);
  canvas.setAttribute("aria-label", $("latency-text").textContent);
}

function drawFacts(shown, known) {
  text($("cell"), shown.database.cell_name || "Silhouette");
  const scene = shown.scene;
  text($("scene"), scene ? scene.id : "none");
  text($("age"), scene ? duration(seconds(shown.basis.scene_age) + since()) : "–");
  text($("skew"), scene ? duration(seconds(scene.skew)) : "–");
  text($("preset"), shown.database.default_policy.preset);
  text($("variant"), shown.basis.scene_variant || (scene ? "unknown" : "–"));
  text($("regions"), shown.regions.map((region) => region.name).join(", ") || "none");
  const defects = shown.basis.defects.map((defect) => defect.message);
  if (!known && defects.length === 0) defects.push(judge().status);
  if (shown.basis.unverified_model) defects.push("The robot's model is not verified.");
  $("problems").hidden = defects.length === 0;
  fill($("defects"), defects, () => defects.map((message) => element("li", "", message)));
}

function drawStatus({ known, status }) {
  was = `${known} ${status}`;
  document.body.className = known ? "known" : "unknown";
  text($("status"), status);
}

// What a fault leaves half drawn is not current.
async function guarded(work) {
  try {
    await work();
  } catch (fault) {
    broken = `This page has failed, load it again: ${fault.message}`;
    drawStatus(judge());
  }
}

// Ends once the images are decoded and drawn.
const draw = () => guarded(drawAll);

async function drawAll() {
  if (!replaying) snapshot = newest;
  const now = judge();
  drawStatus(now);
  drawStops();
  drawHistory();
  if (snapshot === null || !snapshot.database) return;
  drawFacts(snapshot, now.known);
  drawControls(snapshot);
  drawMap(snapshot, now.known);
  drawPaths(snapshot, now.known);
  drawDevices(snapshot);
  drawLatency(snapshot);
  await drawViews(snapshot);
  regions.draw(snapshot, judge().known);
}

// Time alone makes things unknown.
function drawAges() {
  const { known, status } = judge();
  if (`${known} ${status}` !== was) draw();
  else if (snapshot && snapshot.scene) {
    text($("age"), duration(seconds(snapshot.basis.scene_age) + since()));
    drawPaths(snapshot, known);
  }
}
if (!replaying) setInterval(() => guarded(drawAges), 100);
if (!replaying) document.addEventListener("visibilitychange", () => { lose(); connect(); });
window.addEventListener("resize", draw);
if (!replaying) regions.start();
if (!replaying) connect();
