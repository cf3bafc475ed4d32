"use strict";
// A blind page: two dubs side by side, one answer a pair, and a file of all answers of a person.

const data = JSON.parse(document.getElementById("data").textContent);
const find = (id) => document.getElementById(id);
const videos = [find("first"), find("second")], buttons = [...find("answers").children];
const place = `dfrf answers ${data.page}`;
let kept = { person: "", of: {} }, pair = 0, heard = 0, playing = false;
try { kept = { ...kept, ...JSON.parse(localStorage.getItem(place)) }; } catch { /* a browser that keeps nothing */ }

const answers = () => (kept.of[kept.person] ||= {});
const open = (from) => data.pairs.findIndex(({ id }, k) => k >= from && !answers()[id]);

function keep() {
  try { localStorage.setItem(place, JSON.stringify(kept)); } catch { /* as above */ }
}

// ---- the person

function begin(person) {
  kept.person = person;
  keep();
  find("start").hidden = true;
  find("rate").hidden = find("other").hidden = false;
  find("other").textContent = `${person} – someone else?`;
  const next = open(0);
  show(next < 0 ? data.pairs.length - 1 : next);
}

function other() {
  stop();
  find("start").hidden = false;
  find("rate").hidden = find("other").hidden = true;
  find("save").disabled = true;
  find("place").textContent = "";
  find("person").value = "";
  find("person").focus();
}

function save() {
  const file = { dfrf_answers: 1, page: data.page, person: kept.person, answers: answers() };
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([JSON.stringify(file, null, 1)], { type: "application/json" }));
  link.download = `answers_${kept.person.replace(/[^\p{L}\p{N}-]+/gu, "_")}.json`;
  link.click();
}

// ---- the pair

function show(k) {
  pair = Math.max(0, Math.min(k, data.pairs.length - 1));
  find("lost").hidden = true;
  for (const video of videos) video.src = data.pairs[pair][video.id];
  hear(0);
  mark();
  play();
}

function mark() {
  const count = Object.keys(answers()).length, all = data.pairs.length, given = answers()[data.pairs[pair].id];
  for (const button of buttons) button.setAttribute("aria-pressed", button.dataset.answer === given);
  find("place").textContent = `Pair ${pair + 1} of ${all}, ${count} answered`;
  [find("progress").max, find("progress").value] = [all, count];
  [find("back").disabled, find("on").disabled] = [pair === 0, pair === all - 1];
  find("save").disabled = !count;
  find("done").hidden = count < all;
}

function answer(word) {
  answers()[data.pairs[pair].id] = word;
  keep();
  const later = open(pair + 1), next = later < 0 ? open(0) : later;
  if (next >= 0) return show(next);
  mark();
  stop();
  find("save").focus();
}

// ---- the clock: the one that is heard leads, the other follows

function hear(which) {
  heard = which;
  videos.forEach((video, k) => { [video.muted, video.playbackRate] = [k !== heard, 1]; });
  find("sound").innerHTML = `Sound of ${heard + 1} <kbd>S</kbd>`;
}
function stop() {
  playing = false;
  for (const video of videos) video.pause();
  tick();
}

function play() {
  playing = true;
  tick();
  begun();
}

// Both begin together, once both can.
function begun() {
  if (!playing || videos.some((video) => video.readyState < 3)) return;
  for (const video of videos) if (!video.ended) video.play().catch(({ name }) => name === "NotAllowedError" && stop());
}

function follow() {
  const [lead, after] = [videos[heard], videos[1 - heard]], late = lead.currentTime - after.currentTime;
  if (after.ended || lead.currentTime > after.duration) return;
  if (Math.abs(late) > (lead.paused ? 0.001 : 0.2)) after.currentTime = lead.currentTime;
  else after.playbackRate = Math.min(1.2, Math.max(0.8, 1 + late));
}

function tick() {
  find("play").innerHTML = `${playing ? "Pause" : "Play"} <kbd>Space</kbd>`;
}

for (const video of videos) {
  for (const event of ["timeupdate", "seeked", "playing", "pause"]) video.addEventListener(event, follow);
  video.addEventListener("canplay", begun);
  video.addEventListener("waiting", () => videos.forEach((one) => one.pause()));
  video.addEventListener("error", () => { find("lost").hidden = false; });
  video.addEventListener("ended", () => {
    if (video !== videos[heard]) return;
    for (const one of videos) one.currentTime = 0;
    begun();
  });
}

// ---- keys

const ACTS = { back: () => show(pair - 1), on: () => show(pair + 1), sound: () => hear(1 - heard), save, other,
  play: () => (playing ? stop() : play()) };
const KEYS = { " ": "play", s: "sound", arrowleft: "back", arrowright: "on" }, WORDS = { 1: "first", 2: "second", 0: "same" };

document.addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase(), button = event.target.closest("button");
  if (find("rate").hidden || event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
  if (key === " " && button || !(KEYS[key] || WORDS[key])) return;
  event.preventDefault();
  if (WORDS[key]) answer(WORDS[key]);
  else if (!find(KEYS[key]).disabled) ACTS[KEYS[key]]();
});
for (const [id, act] of Object.entries(ACTS)) find(id).addEventListener("click", act);
// A click leaves the focus where it is: the space bar is to play, not to answer again.
find("rate").addEventListener("mousedown", (event) => event.preventDefault());
for (const button of buttons) button.addEventListener("click", () => answer(button.dataset.answer));
find("start").addEventListener("submit", (event) => {
  event.preventDefault();
  if (find("person").value.trim()) begin(find("person").value.trim());
});
find("person").value = kept.person;
