// The picture: frames of film, dub and draft as they come, and what of them is shown.

import { frames } from "./api.js";

const BESIDE = 12; // frames round a line
const LONGEST = 1500; // frames that are asked for at once
const MOST = 4000; // frames that are kept of a kind
const find = (id) => document.getElementById(id);

export class Picture {
  view = "draft";
  frame = 0;
  painted = {}; // what the canvas shows: kind, frame and mark
  #kept = { film: new Map(), dub: new Map(), draft: new Map(), measured: new Map() };
  #asked = {};
  #left = {};
  #drawn = 0;
  #bitmaps = new Map();

  constructor(desk) {
    this.desk = desk;
    this.canvas = find("canvas");
    desk.addEventListener("dub", () => this.#begin());
    desk.addEventListener("line", () => this.fetch());
    desk.addEventListener("curves", () => { if (this.missing("draft") === 0) this.#measure(); });
    desk.addEventListener("saved", () => {
      this.#offer();
      this.fetch(["draft", ...(this.#shows("dub") ? ["dub"] : [])]);
    });
  }

  // The dub can be seen once it is made.
  #offer() {
    const { dubbed } = this.desk.dub;
    document.querySelector("#views [value=dub]").disabled = !dubbed;
    if (this.view === "dub" && !dubbed) this.show("draft");
  }

  #begin() {
    for (const kept of Object.values(this.#kept)) kept.clear();
    this.#bitmaps.clear();
    [this.canvas.width, this.canvas.height] = this.desk.dub.size;
    this.#offer();
  }

  show(view) {
    const input = document.querySelector(`#views [value=${view}]`);
    if (input.disabled) return;
    this.view = view;
    input.checked = true;
    this.fetch([view]);
    this.draw();
  }

  at(frame) {
    if (frame === this.frame) return;
    this.frame = frame;
    this.draw();
    const [first, stop] = this.range || [0, 0];
    if (frame < first || frame >= stop) this.fetch();
  }

  // Frames of the chosen line, or from the shown one on where that is elsewhere; changed ones alone.
  fetch(kinds = ["draft", "film", ...(this.#shows("dub") ? ["dub"] : [])]) {
    const { dub, line } = this.desk;
    const inside = this.frame >= line.first - BESIDE && this.frame < line.stop + BESIDE;
    const from = inside ? line.first : this.frame;
    const to = inside ? line.stop : this.frame + 5 * dub.rate;
    let first = Math.max(0, Math.floor(from - BESIDE)), stop = Math.min(dub.frames, Math.ceil(to + BESIDE));
    if (stop - first > LONGEST) {
      first = Math.max(first, this.frame - BESIDE);
      stop = Math.min(stop, first + LONGEST);
    }
    this.range = [first, stop];
    for (const kind of kinds) this.#fetch(kind, first, stop);
  }

  async #fetch(kind, first, stop) {
    this.#asked[kind]?.abort();
    const { signal } = this.#asked[kind] = new AbortController();
    const kept = this.#kept[kind], have = {};
    for (let k = first; k < stop; k += 1) if (kept.has(k)) have[k] = kept.get(k).mark;
    const at = Math.min(Math.max(this.frame, first), stop - 1);
    const said = (left) => {
      this.#left[kind] = left;
      if (kind !== "draft") return;
      find("drafting").hidden = !left;
      find("drafting").textContent = `drafting, ${left} left`;
    };
    this.#left[kind] = -1;
    try {
      await frames(this.desk.dub.name, { kind, first, stop, at, have }, signal,
        said,
        (frame, mark, body) => {
          kept.set(frame, { mark, body });
          if (kept.size > MOST) kept.delete(kept.keys().next().value);
          said(this.#left[kind] - 1);
          if (frame === this.frame) this.draw();
          this.desk.tell("frame", { kind, frame, mark });
        });
    } catch (error) {
      if (signal.aborted) return;
      this.desk.tell("said", error.message);
    }
    said(0);
    if (kind === "draft") this.#measure();
  }

  // The lips in the draft of the chosen line: after the draft and the curves, whichever comes first.
  #measure() {
    const { line, curves } = this.desk;
    if (curves?.lines[line.cue].opening) this.#fetch("measured", line.first, line.stop);
  }

  // How many frames of a kind have not come yet, of those that were asked for.
  missing(kind) { return this.#left[kind] ?? -1; }

  // Opening and width of the lips in a frame of the draft as it is now; nothing before they are measured.
  measured(frame) {
    const found = this.#kept.measured.get(frame);
    return found && found.mark === this.#kept.draft.get(frame)?.mark ? JSON.parse(new TextDecoder().decode(found.body)) : {};
  }

  #shows(kind) { return this.view === kind; }

  async #image(kind, frame) {
    const found = this.#kept[kind].get(frame);
    if (!found) return null;
    const key = `${kind} ${frame} ${found.mark}`;
    if (!this.#bitmaps.has(key)) {
      this.#bitmaps.set(key, createImageBitmap(new Blob([found.body], { type: "image/jpeg" })));
      if (this.#bitmaps.size > 60) this.#bitmaps.delete(this.#bitmaps.keys().next().value);
    }
    return this.#bitmaps.get(key);
  }

  // The frame as it is now; where it has not come yet, what was drawn stays.
  async draw() {
    const turn = this.#drawn += 1, { view: kind, frame } = this;
    const shown = { kind, frame, mark: this.#kept[kind].get(frame)?.mark };
    const wiped = find("wiping").checked && this.view !== "film";
    const [image, film] = await Promise.all(
      [this.#image(this.view, this.frame), wiped ? this.#image("film", this.frame) : null]);
    if (turn !== this.#drawn) return;
    find("shown").textContent = wiped ? `film | ${this.view}` : this.view;
    if (!image) return;
    const { width, height } = this.canvas, paint = this.canvas.getContext("2d");
    paint.drawImage(image, 0, 0, width, height);
    this.painted = shown;
    if (!film) return;
    const edge = Math.round(width * find("wipe").value / 100);
    const scale = film.width / width;
    if (edge) paint.drawImage(film, 0, 0, edge * scale, film.height, 0, 0, edge, height);
    paint.fillStyle = "#fff";
    paint.fillRect(edge - 1, 0, 2, height);
  }
}
