// SPDX-License-Identifier: Apache-2.0
// Allowed regions: those in force, with the time left, and drawing new ones if the page has the
// role for it. A rectangle is of whole mask pixels, its rims included; the mask that is shown is
// the mask that is sent.
"use strict";

const regions = (() => {

const REGION = [143, 45, 102];
let draft = {};                // by view: {left, top, right, bottom} in mask pixels
let drawing = false;
let draftOf = "";              // the cell and the database that the draft is for

const mayAllow = () => role === "operator" || role === "administrator";
const viewsOf = (shown) => shown.database.views;
const clamp = (v, most) => Math.min(most, Math.max(0, v));

function minutes(s) {
  const whole = Math.max(0, Math.ceil(s));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

// The time of day on the server in `s` seconds, at most.
const clockIn = (s) => since() === Infinity ? "–"
  : new Date(snapshot.time + 1000 * (since() + s)).toLocaleTimeString("en-GB");

function maskOf(box, view) {
  const [width, height] = [view.mask_width, view.mask_height];
  const bytes = new Uint8Array(Math.ceil(width * height / 8));
  for (let y = box.top; y <= box.bottom; ++y) {
    for (let x = box.left; x <= box.right; ++x) {
      const i = y * width + x;
      bytes[i >> 3] |= 1 << (i & 7);
    }
  }
  return { width, height, bits: btoa(bytes.reduce((text, byte) => text + String.fromCharCode(byte), "")) };
}

const pixelsOf = (box) => (box.right - box.left + 1) * (box.bottom - box.top + 1);
const spoken = (box) => `columns ${box.left} to ${box.right}, rows ${box.top} to ${box.bottom}`;
const lasting = () => Number($("region-seconds").value);

// Of the views, one canvas each over that of the view.
function overlays(shown) {
  return viewsOf(shown).map((view, i) => {
    const figure = $("views").children[i];
    const below = figure.firstChild;
    let canvas = figure.querySelector("canvas.region");
    if (!canvas) {
      canvas = element("canvas", "region");
      [canvas.width, canvas.height] = [below.width, below.height];
      figure.append(canvas);
      listen(canvas, view.name);
    }
    return [view, canvas];
  });
}

const viewNamed = (name) => viewsOf(snapshot).find((view) => view.name === name);

// The mask pixel under a pointer.
function pixelAt(event, canvas, view) {
  const at = (offset, length, pixels) => clamp(Math.floor(offset / length * pixels), pixels - 1);
  const box = canvas.getBoundingClientRect();
  return {
    x: at(event.clientX - box.left - canvas.clientLeft, canvas.clientWidth, view.mask_width),
    y: at(event.clientY - box.top - canvas.clientTop, canvas.clientHeight, view.mask_height),
  };
}

function listen(canvas, name) {
  let anchor = null;
  const spread = (event) => {
    const at = pixelAt(event, canvas, viewNamed(name));
    setDraft(name, {
      left: Math.min(anchor.x, at.x), right: Math.max(anchor.x, at.x),
      top: Math.min(anchor.y, at.y), bottom: Math.max(anchor.y, at.y),
    });
  };
  canvas.onpointerdown = (event) => {
    if (!drawing || !event.isPrimary || event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    anchor = pixelAt(event, canvas, viewNamed(name));
    spread(event);
  };
  canvas.onpointermove = (event) => { if (anchor) spread(event); };
  canvas.onpointerup = canvas.onpointercancel = () => { anchor = null; };
  canvas.onkeydown = (event) => {
    if (!drawing) return;
    if (event.key === "Delete" || event.key === "Backspace") setDraft(name, null);
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!step) return;
    event.preventDefault();
    setDraft(name, moved(draft[name], step, event.shiftKey, viewNamed(name)));
  };
}

// The first key makes a rectangle in the middle.
function moved(box, [dx, dy], resize, view) {
  const [right, bottom] = [view.mask_width - 1, view.mask_height - 1];
  if (!box) {
    return { left: Math.round(right * 3 / 8), right: Math.round(right * 5 / 8),
      top: Math.round(bottom * 3 / 8), bottom: Math.round(bottom * 5 / 8) };
  }
  if (resize) {
    return { ...box, right: Math.max(box.left, clamp(box.right + dx, right)),
      bottom: Math.max(box.top, clamp(box.bottom + dy, bottom)) };
  }
  const x = Math.min(right - box.right, Math.max(-box.left, dx));
  const y = Math.min(bottom - box.bottom, Math.max(-box.top, dy));
  return { left: box.left + x, right: box.right + x, top: box.top + y, bottom: box.bottom + y };
}

function setDraft(name, box) {
  draft = { ...draft, [name]: box };
  if (!box) delete draft[name];
  drawRegions(snapshot, judge().known);
}

function setDrawing(on) {
  drawing = on;
  draft = {};
  text($("region-error"), "");
  $("region-form").hidden = !on;
  $("region-draw").hidden = on;
  $("views").classList.toggle("drawing", on);
  drawRegions(snapshot, judge().known);
}

// What was drawn, of the views that there are, in their order.
const drawn = () => viewsOf(snapshot).filter((view) => draft[view.name]);
const named = () => $("region-name").value.trim();

function drawRegions(shown, known) {
  if (shown !== snapshot || !shown || !shown.database) return;  // a newer one is drawn, or none can be
  const { cell_digest, generation } = shown.database;
  if (draftOf !== `${cell_digest} ${generation}`) draft = {};
  draftOf = `${cell_digest} ${generation}`;
  if (!mayAllow() && drawing) return setDrawing(false);
  $("region-tools").hidden = !mayAllow();
  drawList(shown);
  for (const [view, canvas] of overlays(shown)) {
    const context = canvas.getContext("2d");
    context.clearRect(0, 0, canvas.width, canvas.height);
    outline(context, shown.views[view.name].region, [["#fff", 5], [rgb(REGION), 2.5, [7, 4]]]);
    const box = draft[view.name];
    if (drawing) {
      canvas.tabIndex = 0;
      canvas.setAttribute("role", "application");
      canvas.setAttribute("aria-label", `Region in view ${view.name}: ${box ? spoken(box) : "nothing drawn"}`);
    } else {
      canvas.removeAttribute("tabindex");
    }
    if (!box) continue;
    veil(context, maskOf(box, view), REGION, 0.4);
    outline(context, maskOf(box, view), [["#fff", 5], [rgb(REGION), 3]]);
  }
  text($("region-draft"), drawn().map((view) =>
    `${view.name}: ${spoken(draft[view.name])} (${pixelsOf(draft[view.name])} pixels)`).join("; "));
  const s = lasting();
  const sound = named() !== "" && s >= 1 && s <= 600 && drawn().length > 0;
  $("region-next").disabled = $("region-allow").disabled = !known || !sound;
  drawTimes();
}

function drawList(shown) {
  const inForce = shown.regions.map(({ name, pixels }) => ({ name, pixels }));
  fill($("region-list"), [inForce, role], () => inForce.length === 0
    ? [element("li", "note", mayAllow() ? "None is in force."
      : replaying ? "None was in force." : "None is in force. This page is read-only: see 'silhouette region'.")]
    : inForce.map(({ name, pixels }) => {
      const where = Object.entries(pixels).map(([view, n]) => `${view} ${n}`).join(", ");
      const item = element("li", "", "", element("b", "", name), element("span", "left"),
        element("span", "", `obstacles inside are not seen: ${where} pixels`));
      item.dataset.region = name;
      if (!mayAllow()) return item;
      const revoke = element("button", "", "Revoke");
      revoke.type = "button";
      revoke.setAttribute("aria-label", `Revoke ${name}`);
      revoke.onclick = () => call("RevokeRegion", { name });
      item.append(revoke);
      return item;
    }));
}

// Counts down from when the snapshot came: a region ends too late on the page, never too early.
function drawTimes() {
  if (snapshot === null || !snapshot.database) return;
  for (const item of $("region-list").querySelectorAll("li[data-region]")) {
    const region = snapshot.regions.find((of) => of.name === item.dataset.region);
    const left = region ? region.remaining - sinceHeard() : 0;
    text(item.querySelector(".left"), left > 0 ? `ends in ${minutes(left)}` : "ended");
  }
  if (!$("region-confirm").open) return;
  const where = drawn().map((view) => `${view.name} (${pixelsOf(draft[view.name])} pixels)`).join(", ");
  text($("region-meaning"), `Until ${clockIn(lasting())}, for ${lasting()} s, obstacles inside the region `
    + `'${named()}' are not seen in: ${where}. A person inside is not seen there either.`
    + (snapshot.regions.some((of) => of.name === named()) ? " It replaces the region of this name." : ""));
}

// A call of the API. Whether it was done.
async function call(method, request) {
  let why = "";
  try {
    const answer = await fetch(`silhouette.v1.SceneService/${method}`, {
      method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(request),
    });
    if (!answer.ok) why = (await answer.text()).trim();
  } catch {
    why = "The server does not answer; look whether the region is in force.";
  }
  text($("region-error"), why);
  return why === "";
}

async function allow() {
  $("region-confirm").close();
  if (!judge().known) return text($("region-error"), "The page shows nothing current: nothing is allowed.");
  const views = drawn().map((view) => ({ view: view.name, mask: maskOf(draft[view.name], view) }));
  if (await call("AllowRegion", { name: named(), duration: `${lasting()}s`, views })) setDrawing(false);
}

function start() {
  $("region-draw").onclick = () => setDrawing(true);
  $("region-cancel").onclick = () => setDrawing(false);
  $("region-next").onclick = () => { $("region-confirm").showModal(); drawTimes(); };
  $("region-back").onclick = () => $("region-confirm").close();
  $("region-allow").onclick = allow;
  for (const field of ["region-name", "region-seconds"]) {
    $(field).oninput = () => drawRegions(snapshot, judge().known);
  }
  setInterval(drawTimes, 200);
}

return { start, draw: drawRegions };

})();
