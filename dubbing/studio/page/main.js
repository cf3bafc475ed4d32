// The page: its parts, its clock and its keys.

import { ask } from "./api.js";
import { Desk } from "./desk.js";
import { LineForm } from "./line.js";
import { Picture } from "./picture.js";
import { Timeline } from "./timeline.js";

const find = (id) => document.getElementById(id);
const LOST = "The server does not answer. Nothing is saved until it does; this page tries again.";
const FIXED = "The manifest holds the edits of this dub. To change them here, move them to a file of their own.";

const desk = new Desk();
const picture = new Picture(desk);
const form = new LineForm(desk);
const timeline = new Timeline(desk, picture, () => moved());
window.studio = { desk, picture, timeline };

// What is shown follows the sound.
function moved() {
  if (!desk.dub) return;
  const { rate, frames } = desk.dub;
  if (timeline.playing && find("loop").checked && timeline.time >= desk.line.stop / rate) {
    timeline.seek(desk.line.first / rate);
    return;
  }
  const { time } = timeline;
  picture.at(Math.min(frames - 1, Math.floor(time * rate + 0.001)));
  find("clock").textContent = `${Math.floor(time / 60)}:${(time % 60).toFixed(2).padStart(5, "0")}`;
  find("play").textContent = timeline.playing ? "Pause" : "Play";
  timeline.follow();
  if (timeline.playing) requestAnimationFrame(moved);
}

const step = (frames) => timeline.seek((picture.frame + frames + 0.5) / desk.dub.rate);
const wipe = () => {
  find("wipe").hidden = !find("wiping").checked;
  picture.draw();
};

function banner(words) {
  find("banner").textContent = words;
  find("banner").hidden = !words;
}

desk.addEventListener("said", ({ detail }) => { find("state").textContent = detail; });
desk.addEventListener("lost", ({ detail }) => banner(detail || LOST));
desk.addEventListener("found", () => banner(desk.dub.fixed ? FIXED : ""));
desk.addEventListener("making", () => {
  const { running, words, dub } = desk.making;
  find("make").textContent = running ? "Stop" : "Make the dub";
  find("making").textContent = words && `${dub}: ${words}`;
});
for (const kind of ["dub", "edits", "saved"]) {
  desk.addEventListener(kind, () => {
    find("undo").disabled = !desk.canUndo;
    find("redo").disabled = !desk.canRedo;
  });
}

for (const [id, act] of Object.entries({
  make: () => desk.make(), undo: () => desk.undo(), redo: () => desk.redo(), play: () => timeline.play(), back: () => step(-1),
  on: () => step(1), nearer: () => timeline.nearer(2), farther: () => timeline.nearer(0.5),
  shut: () => timeline.addKey((picture.frame + 0.5) / desk.dub.rate, 0),
})) find(id).addEventListener("click", act);
find("wiping").addEventListener("change", wipe);
find("wipe").addEventListener("input", () => picture.draw());
find("views").addEventListener("change", ({ target }) => picture.show(target.value));

const KEYS = {
  " ": () => timeline.play(), a: () => picture.show("film"), b: () => picture.show("dub"),
  d: () => picture.show("draft"), n: () => form.next(), j: () => form.beside(1), k: () => form.beside(-1),
  ",": () => step(-1), ".": () => step(1), "+": () => timeline.nearer(2), "-": () => timeline.nearer(0.5),
  c: () => find("shut").click(), x: () => form.swap(), w: () => { find("wiping").checked = !find("wiping").checked; wipe(); },
};

document.addEventListener("keydown", (event) => {
  if (!desk.dub) return;
  const key = event.key.toLowerCase(), typing = event.target.matches("textarea, select, [type=number]");
  if ((event.ctrlKey || event.metaKey) && (key === "z" || key === "y") && !typing) {
    event.preventDefault();
    if (key === "y" || event.shiftKey) desk.redo(); else desk.undo();
  }
  if (typing || event.ctrlKey || event.metaKey || event.altKey || !KEYS[key]) return;
  if (key === " " && event.target.matches("button:not(#timeline *), input")) return; // they are pressed
  event.preventDefault();
  KEYS[key]();
});

async function open(name) {
  find("state").textContent = "Loading the people of this dub";
  try {
    await desk.open(name);
    find("state").textContent = "";
  } catch (error) {
    find("state").textContent = error.message;
  }
  banner(desk.dub?.fixed ? FIXED : "");
}

const { dubs, lacking } = await ask("/api/dubs");
find("dubs").append(...[...dubs, ...Object.keys(lacking)].map((name) => {
  const option = new Option(name, name);
  option.disabled = name in lacking;
  option.title = lacking[name] || "";
  return option;
}));
find("dubs").addEventListener("change", ({ target }) => open(target.value));
await open(dubs[0]);
