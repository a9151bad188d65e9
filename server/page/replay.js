// SPDX-License-Identifier: Apache-2.0
// Shows the moments of a recording (replay.h) with what page.js draws. Each page has its own
// position: the server only answers what was known at a time.
"use strict";

const LEAST_INTERVAL = 100;    // ms between moments while it plays
const STOP_WIDTH = 3;          // px
const THUMB = 8;               // px: half the width of the slider's thumb

let timeLine = null;
let position = 0;              // ms since 1970: what is to be shown
let failed = "";               // why the newest moment could not be had
let busy = false;              // a request is under way
let playing = null;            // {wall, time}: where it began to play

const timeOfDay = (time) => `${new Date(time).toLocaleTimeString("en-GB")}.${String(time % 1000).padStart(3, "0")}`;
const words = (time) => new Date(time).toLocaleDateString("en-GB", { day: "numeric", month: "long", year: "numeric" })
  + `, ${timeOfDay(time)}`;
const after = (time) => `${((time - timeLine.start) / 1000).toFixed(2)} s`;

// As judge() of page.js.
function judgeRecorded() {
  if (failed) return { known: false, status: failed };
  if (snapshot === null) return { known: false, status: "Loading" };
  if (snapshot.error) return { known: false, status: `Unknown: ${snapshot.error}` };
  if (!snapshot.scene) return { known: false, status: "No scene recorded at this time" };
  if (snapshot.blocked) return { known: false, status: `Was not serving: ${snapshot.blocked}` };
  return { known: true, status: "Was serving" };
}

async function ask(path) {
  const answer = await fetch(path);
  if (!answer.ok) throw new Error(`The server refuses: ${(await answer.text()).trim()}`);
  return answer.json();
}

// Shows the moment at the position; once more if that has changed meanwhile.
async function show() {
  if (busy || timeLine === null) return;
  busy = true;
  let asked;
  try {
    do {
      asked = `moment?time=${position}&${slice()}`;
      const now = await ask(asked);
      snapshot = now.error ? { ...snapshot, ...now } : now;
      failed = "";
    } while (asked !== `moment?time=${position}&${slice()}`);
  } catch (error) {
    const refused = error.message.startsWith("The server refuses");
    failed = `${refused ? error.message : "Connection lost"}: this is not the moment that was asked for`;
    pause();
  }
  busy = false;
  draw();
  drawPosition();
}

function seek(time) {
  position = Math.round(Math.min(timeLine.end, Math.max(timeLine.start, time)));
  return show();
}

// The position as it is shown: times are those of the snapshot, never of what was only asked for.
function drawPosition() {
  const shown = snapshot && snapshot.replay ? snapshot.replay : { time: position, previous: null, next: null };
  $("position").value = position;
  $("position").setAttribute("aria-valuetext", `${words(position)}, ${after(position)}`);
  text($("banner-time"), words(shown.time));
  $("banner-time").dateTime = new Date(shown.time).toISOString();
  text($("offset"), `${after(shown.time)} of ${after(timeLine.end)}`);
  $("back").disabled = shown.previous === null;
  $("forward").disabled = shown.next === null;
  text($("play"), playing ? "Pause" : "Play");
  $("jump").value = timeLine.stops.some((stop) => stop.time === position) ? String(position) : "";
}

// Grey: scenes are recorded. Red: stops.
function drawMarks() {
  const canvas = $("marks");
  const [wide, high] = [Math.max(100, canvas.clientWidth), 18];
  const context = scaled(canvas, wide, high);
  const length = Math.max(1, timeLine.end - timeLine.start);
  const x = (time) => THUMB + (wide - 2 * THUMB) * (time - timeLine.start) / length;
  context.fillStyle = "#fff";
  context.fillRect(x(timeLine.start), 6, x(timeLine.end) - x(timeLine.start), high - 6);
  context.fillStyle = "#8c8c8c";
  for (const [from, to] of timeLine.scenes) context.fillRect(x(from), 6, Math.max(1, x(to) - x(from)), high - 6);
  context.strokeStyle = "#555";
  context.strokeRect(x(timeLine.start), 6, x(timeLine.end) - x(timeLine.start), high - 6);
  context.fillStyle = "#a83200";
  for (const stop of timeLine.stops) context.fillRect(x(stop.time) - STOP_WIDTH / 2, 0, STOP_WIDTH, high);
  const one = timeLine.stops.length === 1;
  canvas.setAttribute("aria-label", `${timeLine.stops.length} ${one ? "stop" : "stops"}; scenes from `
    + timeLine.scenes.map(([from, to]) => `${after(from)} to ${after(to)}`).join(", "));
}

function step(to) {
  if (busy || !snapshot || !snapshot.replay || snapshot.replay[to] === null) return pause();
  return go(snapshot.replay[to]);
}

function pause() {
  playing = null;
  drawPosition();
}

function go(time) {
  pause();
  return seek(time);
}

function play() {
  if (position >= timeLine.end) position = timeLine.start;
  playing = { wall: performance.now(), time: position };
  advance(playing);
}

async function advance(run) {
  while (playing === run) {
    const began = performance.now();
    await seek(run.time + (began - run.wall) * Number($("speed").value));
    if (position >= timeLine.end) pause();
    await new Promise((done) => { setTimeout(done, Math.max(0, LEAST_INTERVAL - (performance.now() - began))); });
  }
}

function pressed(event) {
  if (event.altKey || event.ctrlKey || event.metaKey || event.shiftKey) return;
  const at = event.target;
  const takes = at.closest("select, .scroll") || at.matches("input:not(#position)");
  if (takes || (event.key === " " && at.closest("button"))) return;
  const act = { ArrowLeft: () => step("previous"), ArrowRight: () => step("next"), " ": () => (playing ? pause() : play()) };
  if (!act[event.key]) return;
  event.preventDefault();
  act[event.key]();
}

async function open() {
  try {
    timeLine = await ask("recording");
  } catch (error) {
    failed = "Connection lost: reload this page";
    return draw();
  }
  document.title = "Silhouette: recording";
  Object.assign($("position"), { min: timeLine.start, max: timeLine.end });
  $("jump").append(new Option(`${timeLine.stops.length} recorded`, ""), ...timeLine.stops.map((stop) => new Option(
    `${timeOfDay(stop.time)} ${stop.state}${stop.reason && `: ${stop.reason}`}, ${stop.client}`, stop.time)));
  $("jump").disabled = timeLine.stops.length === 0;
  text($("recording-notes"), [
    timeLine.other_database ? "The recording is of another generation of the database: the map and the outlines are of this one." : "",
    timeLine.cut ? "The recording has no end: it was cut, or is still written." : "",
    timeLine.damage,
  ].join(" ").trim());
  $("position").oninput = () => go(Number($("position").value));
  $("jump").onchange = () => { if ($("jump").value) go(Number($("jump").value)); };
  $("play").onclick = () => (playing ? pause() : play());
  $("back").onclick = () => step("previous");
  $("forward").onclick = () => step("next");
  $("speed").onchange = () => { if (playing) play(); };
  document.addEventListener("keydown", pressed);
  window.addEventListener("resize", drawMarks);
  drawMarks();
  seek(timeLine.scenes.length ? timeLine.scenes[0][0] : timeLine.start);
}

open();
