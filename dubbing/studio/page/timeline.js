// The sound, the lanes of lines and words, and the curves of the lips with the keys of their strength.

import WaveSurfer from "/design/vendor/wavesurfer.js";
import { dubPath } from "./api.js";
import { clamp, Lanes, rounded } from "./lanes.js";
import { drag, heardAt, seen } from "./moving.js";

const AXIS = 52; // px to both sides of the curves, as in studio.css
const MOST = 1.5; // of strength
const STEP = 0.05; // of strength
const LEAST = 0.1; // eye distances in sight
const BELOW = 0.1; // of what is in sight, below 0
const find = (id) => document.getElementById(id);
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// Lowest and highest eye distance of the axis for values, some of which are nothing; openings begin at 0.
export function bounds(values, measure) {
  const own = values.filter((one) => one !== null), low = measure === "opening" || !own.length ? 0 : Math.min(...own);
  return [low, low + 1.1 * Math.max(LEAST, ...own.map((one) => one - low))];
}

export class Timeline {
  zoom = 1;
  #wave = null;
  #plot = null;
  #ready = false; // whether the sound is there
  #laying = false; // what is laid anew takes its focus back: that is no step of the user
  #later = 0; // a layout that is asked for
  #at = 0; // the moment while nothing plays: the player takes a while to go where it is told to

  constructor(desk, picture, moved) {
    this.desk = desk;
    this.picture = picture;
    this.lanes = new Lanes(desk);
    this.moved = moved;
    desk.addEventListener("dub", () => this.#close());
    desk.addEventListener("curves", () => this.#open());
    desk.addEventListener("line", () => { this.zoom = 1; this.seek(this.desk.line.first / this.desk.dub.rate); this.lay(); });
    for (const kind of ["edits", "saved", "words", "dropped"]) desk.addEventListener(kind, () => this.lay());
    desk.addEventListener("frame", ({ detail }) => { if (detail.kind === "measured") this.#later ||= requestAnimationFrame(() => this.lay()); });
    find("measure").addEventListener("change", () => this.lay());
    find("timeline").addEventListener("focusin", ({ target }) => { if (target.matches("[data-block], .key")) this.#show(target); });
    new ResizeObserver(() => this.lay()).observe(find("timeline"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#open());
  }

  get time() { return this.playing ? this.#wave.getCurrentTime() : this.#at; }
  get playing() { return Boolean(this.#wave?.isPlaying()); }
  play() { return this.#wave?.playPause().catch((error) => this.desk.tell("said", error.message)); }

  seek(seconds) {
    this.#at = clamp(seconds, 0, this.desk.dub.frames / this.desk.dub.rate);
    if (this.#ready) this.#wave.setTime(this.#at);
    this.moved();
  }

  // Brings what is in focus into sight.
  #show(tag) {
    const [low, high] = this.sight, part = tag.getBoundingClientRect(), all = find("wave").getBoundingClientRect();
    if (this.#laying || this.playing || this.desk.dragged || (part.right > all.left && part.left < all.right)) return;
    this.seek(low + ((part.left + part.right) / 2 - all.left) / all.width * (high - low));
  }

  nearer(factor) { this.zoom = clamp(this.zoom * factor, 1, 64); this.lay(); }

  // Seconds that are in sight: the chosen line, or a part of it round the moment that is shown.
  get sight() {
    const { dub: { rate, frames }, line } = this.desk;
    const [low, high] = [Math.max(0, line.first / rate - 0.2), Math.min(frames / rate, line.stop / rate + 0.2)];
    const half = (high - low) / this.zoom / 2;
    const middle = clamp(this.time, low + half, high - half);
    return [middle - half, middle + half];
  }

  #close() {
    this.#at = this.time;
    this.#ready = false;
    this.#wave?.destroy();
    this.#plot?.destroy();
    this.#wave = this.#plot = null;
    find("lane").replaceChildren();
  }

  #open() {
    if (!this.desk.curves) return;
    this.#close();
    const { dub, curves } = this.desk;
    this.#wave = WaveSurfer.create({ container: find("wave"), height: 56, peaks: [curves.peaks],
      duration: dub.frames / dub.rate, url: `${dubPath(dub.name)}/sound`, waveColor: colour("wave"),
      progressColor: colour("played"), cursorColor: colour("text"), cursorWidth: 2, hideScrollbar: true,
      autoScroll: false, dragToSeek: true });
    // A player that is on its way forgets where else it was told to go.
    const wave = this.#wave, astray = () => Math.abs(wave.getCurrentTime() - Math.min(this.#at, wave.getDuration())) > 0.001;
    wave.getMediaElement().addEventListener("seeked", () => { if (wave === this.#wave && !this.playing && astray()) wave.setTime(this.#at); });
    this.#wave.on("timeupdate", () => this.moved());
    this.#wave.on("ready", () => { this.#ready = true; this.seek(this.#at); this.lay(); });
    this.#wave.on("interaction", (time) => { this.#at = time; this.moved(); });
    this.#wave.on("play", () => this.moved());
    this.#wave.on("pause", () => { this.#at = this.#wave.getCurrentTime(); this.moved(); });
    this.lay();
  }

  // Everything where it belongs now.
  lay() {
    this.#later = 0;
    this.#laying = true;
    this.#lay();
    this.#laying = false;
  }

  #lay() {
    if (!this.#wave || !this.desk.line || !this.desk.curves || this.desk.dragged) return;
    const [low, high] = this.sight;
    const wide = find("wave").clientWidth;
    this.#wave.zoom(wide / (high - low));
    this.#wave.setScrollTime(low);
    this.lanes.lay(low, high, wide);
    this.#curve(low, high);
    this.mark();
  }

  // Where the moment that is shown is in the curves.
  mark() {
    const now = find("curve").querySelector(".now");
    if (now) now.style.left = `${this.#plot.valToPos(this.time, "x")}px`;
  }

  follow() {
    const [low, high] = this.sight;
    if (this.zoom > 1 && this.#plot && (low !== this.#plot.scales.x.min || high !== this.#plot.scales.x.max)) this.lay();
    else this.mark();
  }

  // What is wanted of the lips in the frames of the chosen line; nothing where the film's own mouth stays.
  wanted() {
    const { dub: { rate }, line: { cue, edit, moments, strengths }, curves } = this.desk;
    const lips = curves.lines[cue][find("measure").value], own = lips?.[edit.style] || [];
    return own.map((_, k) => {
      if (edit.film_mouth.some(({ start, end }) => start <= (k + 0.5) / rate && (k + 0.5) / rate < end)) return null;
      const at = clamp(moments[k] * rate - 0.5, 0, own.length - 1), floor = Math.floor(at);
      const heard = own[floor] + (at - floor) * ((own[floor + 1] ?? own[floor]) - own[floor]);
      return lips.closed + strengths[k] * (heard - lips.closed);
    });
  }

  #curve(low, high) {
    const { dub, line, curves } = this.desk, lips = curves.lines[line.cue][find("measure").value];
    const times = line.strengths.map((_, k) => (line.first + k + 0.5) / dub.rate);
    const heard = lips?.["as spoken"] || [], wanted = this.wanted();
    const measured = line.strengths.map((_, k) => this.picture.measured(line.first + k)[find("measure").value] ?? null);
    const data = [times, heard, wanted, line.strengths, measured];
    const size = { width: find("curve").clientWidth, height: 180 };
    if (!this.#plot) this.#plot = new uPlot(this.#options(size), data, find("curve"));
    else { this.#plot.setSize(size); this.#plot.setData(data, false); }
    const [bottom, top] = bounds([...heard, ...wanted, ...measured], find("measure").value);
    this.#plot.batch(() => {
      this.#plot.setScale("x", { min: low, max: high });
      this.#plot.setScale("y", { min: bottom - BELOW * (top - bottom), max: top }); // a key at 0 covers no axis
      this.#plot.setScale("s", { min: -BELOW * MOST, max: MOST });
    });
    this.#handles(line);
  }

  #options(size) {
    const axis = { stroke: colour("quiet"), grid: { stroke: colour("edge"), width: 1 }, ticks: { show: false }, size: AXIS };
    const series = (label, stroke, more = {}) => ({ label, stroke: colour(stroke), width: 2, points: { show: false }, ...more });
    return { ...size, legend: { show: false }, padding: [14, 0, 0, 0],
      cursor: { drag: { x: false, y: false }, points: { show: false }, bind: { dblclick: () => null } }, // else it sets scales
      scales: { x: { time: false }, y: {}, s: {} },
      axes: [{ ...axis, size: 30, values: (_, ticks) => ticks.map((t) => `${t.toFixed(2)} s`) },
        { ...axis, label: "% of eye distance", labelSize: 20, size: AXIS - 20,
          values: (_, ticks) => ticks.map((t) => Number((100 * t).toFixed(1))) },
        { ...axis, scale: "s", side: 1, grid: { show: false }, label: "strength", labelSize: 20, size: AXIS - 20 }],
      series: [{}, series("heard", "heard", { dash: [2, 4] }), series("wanted", "wanted", { width: 3 }),
        series("strength", "share", { scale: "s", dash: [8, 5] }), series("measured", "good")],
      hooks: { init: [(plot) => {
        const now = document.createElement("div");
        now.className = "now";
        plot.over.append(now);
        plot.over.addEventListener("click", (event) => {
          if (event.target === plot.over) this.seek(plot.posToVal(event.offsetX, "x"));
        });
        plot.over.addEventListener("dblclick", (event) => {
          if (event.target !== plot.over) return;
          this.addKey(plot.posToVal(event.offsetX, "x"), rounded(plot.posToVal(event.offsetY, "s"), STEP));
        });
      }] } };
  }

  // A key at a moment of the dub.
  addKey(seconds, strength) {
    const { line } = this.desk;
    const at = rounded(clamp(heardAt(this.desk, line, seconds), 0, line.seconds), 0.01);
    const rest = line.edit.keys.filter((key) => Math.abs(key.at - at) > 0.005);
    this.#change(line, [...rest, { at, strength: clamp(strength, 0, MOST) }]);
  }

  #change(line, keys) { this.desk.change(line, { keys: [...keys].sort((a, b) => a.at - b.at) }); }

  #handles(line) {
    const { dub } = this.desk, plot = this.#plot, { over } = plot;
    const held = document.activeElement?.dataset?.key;
    for (const old of over.querySelectorAll(".key")) old.remove();
    line.edit.keys.forEach((key, number) => {
      const handle = document.createElement("button");
      handle.className = "key";
      handle.dataset.key = number;
      handle.disabled = dub.fixed;
      const place = ({ at, strength }) => {
        handle.style.left = `${plot.valToPos(seen(this.desk, line, at), "x")}px`;
        handle.style.top = `${plot.valToPos(strength, "s")}px`;
        handle.setAttribute("aria-label", `Key at ${at} s, strength ${strength}`);
        handle.title = `${at} s: ${strength}`;
      };
      const moved = (at, strength) => ({ at: rounded(clamp(at, 0, line.seconds - 0.005), 0.01),
        strength: rounded(clamp(strength, 0, MOST), STEP) });
      const changed = (one) => this.#change(line, line.edit.keys.map((old, k) => k === number ? one : old));
      place(key);
      let one = key;
      drag(this.desk, handle, (across, down) => {
        one = moved(heardAt(this.desk, line, plot.posToVal(plot.valToPos(seen(this.desk, line, key.at), "x") + across, "x")),
          plot.posToVal(plot.valToPos(key.strength, "s") + down, "s"));
        place(one);
      }, (did) => { if (did) changed(one); });
      handle.addEventListener("keydown", (event) => {
        const [across, up] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] || [];
        if (event.key === "Delete" || event.key === "Backspace") this.#change(line, line.edit.keys.filter((_, k) => k !== number));
        else if (across !== undefined) changed(moved(key.at + across / dub.rate, key.strength + up * STEP));
        else return;
        event.preventDefault();
      });
      over.append(handle);
    });
    over.querySelector(`[data-key="${held}"]`)?.focus();
  }
}
