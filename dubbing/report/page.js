"use strict";
// The page of a report: one dub large, its lines, notes about them, and who is in it.

const data = JSON.parse(document.getElementById("data").textContent);
const find = (id) => document.getElementById(id);
const WORDS = { passed: "in sync", warned: "look closely", failed: "failed", unjudged: "not judged", missing: "not made",
  pass: "in sync", warn: "look closely", fail: "failed" };
const ORDER = ["failed", "warned", "unjudged", "missing", "passed"];
const source = find("source"), result = find("result"), { status } = find("line").elements;
const tools = find("tools").elements;
let name = null, dub = null, line = null;

// An element with attributes and children; what is empty is left out.
function make(kind, more, ...children) {
  const tag = Object.assign(document.createElement(kind), more);
  tag.append(...children.flat().filter((child) => child || child === 0));
  return tag;
}
const quiet = (words) => words && make("p", { className: "quiet" }, words);
const tag = (state, words = WORDS[state] || state) => make("span", { className: `tag ${state}` }, words);
const colour = (of) => getComputedStyle(document.documentElement).getPropertyValue(`--${of}`).trim();
const percent = (share) => `${Math.round(100 * share)} %`;

// A curve with its title, both axes and their zero; drawn where there is room for it.
function plot(holder, title, across, up, xs, ys, size = 220) {
  const finite = ys.map((y) => (Number.isFinite(y) ? y : null)), some = finite.filter((y) => y !== null);
  if (some.length < 2) return;
  const axis = (label, more) => ({ label, stroke: colour("quiet"), grid: { stroke: colour("edge"), width: 1 },
    ticks: { show: false }, labelSize: 20, ...more });
  const zero = (u) => {
    const { ctx, bbox } = u, at = u.valToPos(0, "x", true);
    if (xs[0] >= 0 || at < bbox.left) return;
    ctx.fillStyle = colour("text");
    ctx.fillRect(at - 1, bbox.top, 2, bbox.height);
  };
  new uPlot({ title, width: Math.max(240, holder.clientWidth), height: size, legend: { show: false },
    cursor: { show: false }, scales: { x: { time: false }, y: { range: [Math.min(0, ...some), Math.max(...some) * 1.08] } },
    axes: [axis(across, { size: 30 }), axis(up, { size: 46 })],
    series: [{}, { stroke: colour("wanted"), width: 2, points: { show: false } }], hooks: { draw: [zero] },
  }, [xs, finite], holder);
}
const room = () => make("div", { className: "plot" });

function failure({ failure: lost }) {
  return lost && make("div", {}, make("p", { className: "failed" }, make("b", {}, lost.stage), `: ${lost.what} `,
    lost.where && `(${lost.where})`), lost.remedy && make("p", {}, make("b", {}, "What to do: "), lost.remedy),
  lost.trace && make("details", {}, make("summary", {}, "Trace"), make("pre", {}, lost.trace)));
}

function times({ stages }) {
  const row = (kind, cells) => make("tr", {}, cells.map((cell) => make(kind, {}, cell)));
  const took = ({ seconds, recorded_seconds: kept }) =>
    (seconds !== null ? `${seconds} s` : kept ? `kept (${kept} s when made)` : "–");
  return Object.keys(stages).length > 0 && make("details", {}, make("summary", {}, "Work"),
    make("table", { className: "quiet" }, row("th", ["stage", "time", "why it ran"]),
      Object.entries(stages).map(([stage, one]) => row("td", [stage, took(one), one.reasons.join(", ")]))));
}

function syncOf(holder, sync, title) {
  const { curve, parts, confidence, source_confidence: own } = sync || {};
  const shares = Object.entries(parts || {}).map(([part, share]) => `${part} ${percent(share)}`).join(", ");
  const sure = Number.isFinite(confidence) && `confidence ${confidence.toFixed(3)}` +
    (Number.isFinite(own) ? `, the film's ${own.toFixed(3)}` : "");
  const drawn = room();
  holder.append(...[drawn, quiet(shares && `As in the film: ${shares}`), quiet(sure)].filter(Boolean));
  const middle = ((curve || []).length - 1) / 2;
  plot(drawn, title, "frames that the mouth is late", "distance",
    (curve || []).map((_, k) => k - middle), curve || []);
}

// ---- the dub that is shown

function choose(other) {
  if (!data.dubs[other]) return;
  [name, dub] = [other, data.dubs[other]];
  for (const video of [source, result]) { video.pause(); video.removeAttribute("src"); video.load(); }
  find("lost").hidden = true;
  if (dub.video) result.src = encodeURI(dub.video).replace(/[#?]/g, encodeURIComponent);
  if (dub.video && dub.source) source.src = encodeURI(dub.source).replace(/[#?]/g, encodeURIComponent);
  find("picture").hidden = !dub.video;
  views(Boolean(dub.video && dub.source));
  about();
  lines();
  lay();
  history.replaceState(null, "", `#dub-${encodeURIComponent(name)}`);
}

function views(both) {
  find("views").disabled = find("original").disabled = !both;
  if (!both) find("original").checked = false;
  look(both ? find("views").querySelector(":checked").value : "result");
}

function look(view) {
  find("views").querySelector(`[value=${view}]`).checked = true;
  source.classList.toggle("unseen-film", view !== "source");
  result.classList.toggle("unseen-film", view !== "result");
  find("shown").textContent = view === "source" ? "film" : "dub";
  source.muted = !find("original").checked;
  result.muted = find("original").checked;
}

function about() {
  const { mark } = dub;
  const frames = (words, some) => some.length > 0 && `${words}: ${some.join("; ")}`;
  const told = dub.lines.length > 1 ? [] : [frames("The film's own face in frames", dub.kept),
    frames("Something lies over the mouth; look at frames", dub.overlaid)];
  const people = Object.entries(data.identities).filter(([of]) => of === dub.identity || dub.identity.split(", ").includes(of));
  find("about").replaceChildren(make("h2", {}, dub.video ? make("a", { href: dub.video }, name) : name, " ", tag(dub.verdict)),
    failure(dub) || make("p", {}, dub.sync ? dub.sync.reason.replaceAll(" %", "\u00a0%") : "Not checked."),
    make("p", { className: "quiet" }, "With the face of ", ...people.flatMap(([of], k) => [k ? ", " : "",
      make("a", { href: `#identity-${of}` }, of)]), "."), ...told.filter(Boolean).map(quiet),
    dub.short_lines > 0 && dub.lines.length > 1 ? quiet(`${dub.short_lines} of its lines are dubbed in part.`) : "",
    dub.undubbed.length > 0 ? make("details", {}, make("summary", {}, `${dub.undubbed.length} line` +
      `${dub.undubbed.length === 1 ? "" : "s"} of the script that nobody dubs`), dub.undubbed.map((one) => make("p", {},
      make("span", { className: "time" }, one.in), " ", make("b", {}, one.speaker), ` ${one.words} `,
      make("span", { className: "quiet" }, one.why)))) : "",
    proof(),
    quiet([`${dub.label ? "With" : "Without"} the visible mark`, mark ? `invisible mark ${mark}` : "without the invisible mark",
      mark && dub.mark_found === false && "which is not found again in this video: the face is too small or too short in it",
      dub.signed ? "with signed credentials" : "without signed credentials",
      dub.film_credentials && `of the film it was made of, ${dub.film_credentials}`].filter(Boolean).join(", ") + "."));
  find("sync").replaceChildren();
  syncOf(find("sync"), dub.sync, "How far sound and mouth are apart, by offset");
  find("sync").append(times(dub) || "");
}

function proof() {
  const { untouched: own } = dub;
  return own ? quiet(`${own.frames} of ${own.of} frames are the film's own` + (own.identical
    ? `, identical to it, SHA-256 ${own.source.slice(0, 16)}.` : own.psnr !== null ? `, encoded at ${own.psnr} dB or more.` : ".")) : "";
}

// ---- its lines, and notes about them

const place = `dfrf notes ${location.pathname} ${data.manifest}`;
let notes = {};
try { notes = JSON.parse(localStorage.getItem(place)) || {}; } catch { /* a browser that keeps nothing */ }
const noted = (of) => notes[name]?.[of.cue] || { note: of.note, status: of.status };

function write(part) {
  (notes[name] ||= {})[line.cue] = { ...noted(line), ...part };
  try { localStorage.setItem(place, JSON.stringify(notes)); } catch { /* as above */ }
  lines();
}

// A take of the chosen line, and how it was when it was made.
function taken({ take, made: there, verdict, offset_ms: late, closeness: near }) {
  const made = there ? ["", make("b", {}, WORDS[verdict] || "not judged"), Number.isFinite(late) && `, ${late} ms late`,
    Number.isFinite(near) && `, mouth follows the words: ${percent(near)} of the original`] : ["not made as it is now"];
  return make("p", { className: "quiet" }, `Take ${take || "without a name"}${take === line.take ? ", chosen" : ""}: `, ...made);
}

function lines() {
  const nav = find("lines"), held = nav.contains(document.activeElement);
  line = dub.lines.includes(line) ? line : dub.lines[0];
  find("line").hidden = !line;
  nav.hidden = dub.lines.length < 2;
  nav.replaceChildren(...dub.lines.map((one) => {
    const { status: as } = noted(one);
    const button = make("button", { type: "button" }, make("span", {}, one.line),
      make("span", { className: "said" }, [one.speaker || one.identity, one.words].filter(Boolean).join(": ")),
      as === "open" ? tag(one.verdict || "unjudged") : tag(as));
    if (one === line) button.setAttribute("aria-current", "true");
    button.addEventListener("click", () => go(one));
    return button;
  }));
  if (held) nav.querySelector("[aria-current]")?.focus();
  find("save").disabled = !written().length;
  if (!line) return;
  const { note, status: as } = noted(line), several = dub.lines.length > 1;
  find("told").replaceChildren(...[make("h2", {}, `Line ${line.line} · ${line.speaker || line.identity} · `,
    make("span", { className: "time" }, line.in)), line.words && make("p", {}, line.words),
  several && make("p", {}, tag(line.verdict || "unjudged"), ` ${line.reason || ""}`),
  line.edit && quiet(`Edited: ${line.edit}`), ...line.takes.map(taken), line.reach && make("p", { className: line.short ? "warn" : "quiet" },
    `${line.short ? "Dubbed in part: " : ""}${line.reach}`),
  several && line.own_pixels && quiet(`The film's own face in frames: ${line.own_pixels}`),
  several && line.overlaid && quiet(`Something lies over the mouth and stays there, in frames: ${line.overlaid}`),
  line.loudness !== null && quiet(`${line.loudness.toFixed(1)} LUFS`)].filter(Boolean));
  if (document.activeElement !== find("note")) find("note").value = note;
  status.value = as;
}

function go(one) {
  line = one;
  lines();
  seek(one.seconds);
}

// Every note and status that differs from what the report was made with, with what tells its line again.
function written() {
  return Object.entries(notes).flatMap(([of, some]) => (data.dubs[of]?.lines || []).filter((one) => some[one.cue] &&
    (some[one.cue].note !== one.note || some[one.cue].status !== one.status)).map((one) => ({ dub: of, line: one.line,
    cue: one.cue, told: one.told, in: one.in, ...some[one.cue] })));
}

function save() {
  const text = JSON.stringify({ dfrf_notes: 1, manifest: data.manifest, notes: written() }, null, 1);
  const link = make("a", { href: URL.createObjectURL(new Blob([text], { type: "application/json" })),
    download: `${data.manifest.split("/").pop().replace(/\.\w+$/, "")}.notes.json` });
  link.click();
}

// ---- the clock

const length = () => result.duration || 0;
const clock = (at) => `${Math.floor(at / 60)}:${(at % 60).toFixed(2).padStart(5, "0")}`;

function seek(at) {
  const to = Math.max(0, at);
  if (result.readyState) result.currentTime = Math.min(to, length());
  else result.addEventListener("loadedmetadata", () => { result.currentTime = to; }, { once: true });
}
const step = (frames) => { result.pause(); seek((Math.floor(result.currentTime * dub.rate + 0.01) + frames + 0.5) / dub.rate); };
const play = () => (result.paused ? result.play().catch(() => {}) : result.pause());

// The source follows the dub; past its end it shows its last frame.
function follow() {
  const at = dub.source_start + result.currentTime, over = at >= source.duration;
  if (source.readyState && Math.abs(source.currentTime - at) > (result.paused ? 0.01 : 0.1)) {
    source.currentTime = Math.min(at, source.duration);
  }
  if (result.paused || over) source.pause();
  else if (source.paused) source.play().catch(() => {});
}

function tick() {
  const { currentTime: at } = result, end = line && dub.lines.length > 1 ? line.out_frame / dub.rate : length();
  if (find("loop").checked && !result.paused && at >= end - 0.02) seek(dub.lines.length > 1 ? line.seconds : 0);
  find("seek").max = length();
  find("seek").value = at;
  find("clock").textContent = clock(at);
  find("play").textContent = result.paused ? "Play" : "Pause";
  if (!result.paused) requestAnimationFrame(tick);
}

for (const event of ["playing", "pause", "seeking", "seeked", "timeupdate", "ended"]) result.addEventListener(event, follow);
for (const event of ["play", "pause", "seeked", "loadedmetadata"]) result.addEventListener(event, tick);
result.addEventListener("ended", () => { if (find("loop").checked) { seek(0); play(); } });
result.addEventListener("waiting", () => source.pause());
source.addEventListener("loadedmetadata", follow);
source.addEventListener("error", () => { if (source.hasAttribute("src")) views(false); });
result.addEventListener("error", () => {
  if (!result.hasAttribute("src")) return;
  find("lost").hidden = false;
  find("picture").hidden = true;
});

// ---- the line-up

const closeness = (of) => data.dubs[of].sync?.closeness || 0;
const BY = { worst: (a, b) => ORDER.indexOf(data.dubs[a].verdict) - ORDER.indexOf(data.dubs[b].verdict) || closeness(a) - closeness(b),
  name: (a, b) => a.localeCompare(b, undefined, { numeric: true }), place: (a, b) => data.dubs[a].place - data.dubs[b].place };

function wanted() {
  const shown = [...find("verdicts").querySelectorAll(":checked")].map(({ value }) => value);
  const words = tools.name.value.toLowerCase();
  return Object.keys(data.dubs).sort(BY[tools.sort.value]).filter((of) => shown.includes(data.dubs[of].verdict) &&
    `${of} ${data.dubs[of].identity}`.toLowerCase().includes(words));
}

function lay() {
  const held = find("lineup").contains(document.activeElement);
  find("lineup").replaceChildren(...wanted().map((of) => {
    const { thumbnail, verdict } = data.dubs[of];
    const button = make("button", { type: "button" }, thumbnail ? make("img", { className: "thumb", src: thumbnail, loading: "lazy", alt: "" })
      : make("span", { className: "thumb" }), make("span", { className: "said" }, of), tag(verdict));
    button.dataset.name = of;
    if (of === name) button.setAttribute("aria-current", "true");
    button.addEventListener("click", () => choose(of));
    return button;
  }));
  const current = find("lineup").querySelector("[aria-current]");
  if (held) current?.focus();
  current?.scrollIntoView({ block: "nearest", inline: "nearest" });
}

function people() {
  find("people").append(...(Object.keys(data.identities).length ? [make("h2", {}, "People")] : []),
    ...Object.entries(data.identities).map(([of, one]) => {
      const { consent } = one, any = (value, other) => (value || [other]).join(", ");
      const details = make("details", {}, make("summary", {}, "Learning"));
      details.addEventListener("toggle", () => {
        if (details.childElementCount > 1) return;
        details.append(...[make("p", {}, one.sync && tag(one.sync.verdict), one.sync && ` The clip itself: ${one.sync.reason}`)]);
        syncOf(details, one.sync, "The clip itself: how far sound and mouth are apart");
        for (const [key, title, up] of [["loss", "Loss while learning", "loss"], ["psnr", "Likeness of the pixels learned", "PSNR, dB"]]) {
          const drawn = room();
          details.append(drawn);
          plot(drawn, title, "% of the steps", up, one[key].map((_, k) => (100 * k) / Math.max(1, one[key].length - 1)), one[key]);
        }
        details.append(times(one) || "", one.contact_sheet ? make("img", { src: one.contact_sheet, loading: "lazy", alt: "contact sheet" }) : "");
      });
      const sums = [["SHA-256 of the form", consent.sha256], ["of the file it names", consent.file_sha256]];
      return make("section", { className: "card", id: `identity-${of}` }, make("h2", {}, of), make("p", {}, one.clip), failure(one),
        make("p", {}, `Consent: ${consent.by}, ${consent.reference}${consent.date ? ` (${consent.date})` : ""}`),
        quiet(`languages: ${any(consent.languages, "any")}; until ${consent.until || "further notice"}; films: ${any(consent.films, "any")}` +
          sums.map(([words, sum]) => (sum ? `; ${words} ${sum}` : "")).join("")),
        quiet(one.learned), ...one.warnings.map(quiet), details);
    }));
}

// ---- keys

const near = (step, some, at) => some[some.indexOf(at) + step];
const KEYS = { " ": play, a: () => find("views").disabled || look("source"), b: () => look("result"), s: () => find("original").click(),
  l: () => find("loop").click(), ",": () => step(-1), ".": () => step(1), t: () => find("moment").click(),
  j: () => near(1, dub.lines, line) && go(near(1, dub.lines, line)), k: () => near(-1, dub.lines, line) && go(near(-1, dub.lines, line)),
  "]": () => choose(near(1, wanted(), name)), "[": () => choose(near(-1, wanted(), name)) };

document.addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase(), typing = event.target.matches("textarea, select, [type=search]");
  if (!dub || typing || event.ctrlKey || event.metaKey || event.altKey || !KEYS[key]) return;
  if (key === " " && event.target.matches("button, input, a, summary")) return;
  event.preventDefault();
  KEYS[key]();
});
for (const [id, act] of Object.entries({ play, back: () => step(-1), on: () => step(1), save,
  moment: () => {
    find("note").value = `${[find("note").value, `${clock(result.currentTime)}: `].filter(Boolean).join(" ")}`;
    find("note").focus();
    write({ note: find("note").value });
  } })) find(id).addEventListener("click", act);
find("seek").addEventListener("input", () => seek(Number(find("seek").value)));
find("views").addEventListener("change", ({ target }) => look(target.value));
find("original").addEventListener("change", () => look(find("views").querySelector(":checked").value));
find("note").addEventListener("input", () => write({ note: find("note").value }));
for (const one of status) one.addEventListener("change", () => write({ status: one.value }));
for (const form of ["tools", "line"]) find(form).addEventListener("submit", (event) => event.preventDefault());
find("tools").addEventListener("input", lay);

find("verdicts").append(...ORDER.filter((verdict) => data.counts[verdict]).map((verdict) => make("label", {},
  make("input", { type: "checkbox", name: "verdict", value: verdict, checked: true }), ` ${data.counts[verdict]} `, tag(verdict))));
const names = wanted();
find("tools").hidden = names.length < 2;
find("empty").hidden = names.length > 0;
document.querySelector("main").hidden = !names.length;
people();
find("foot").append(...data.warnings.map(quiet), make("p", {}, `${data.manifest} · ${data.seconds} s` +
  `${data.peak_memory_mb ? ` · at most ${data.peak_memory_mb} MB` : ""} · ${data.machine.cores} cores · exit code ${data.code}. ` +
  "The pictures are AI-generated; every file says so in its metadata."));
if (names.length) choose(data.dubs[decodeURIComponent(location.hash.slice(5))] ? decodeURIComponent(location.hash.slice(5)) : names[0]);
