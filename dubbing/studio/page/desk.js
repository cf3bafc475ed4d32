// The dub on the page: its lines, which one is chosen, and every change of an edit, saved at once.

import { ask, dubPath, put } from "./api.js";

export const AS_SPOKEN = { shift: 0, strength: 1, style: "as spoken", note: "", keys: [], film_mouth: [], moved: [], status: "open", curves: null,
  take: "", audio: null };
const LOOK_MS = 500, ELSEWHERE = "Changed elsewhere: shown now";
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

// Events: `dub` another one; `line` another is chosen; `edits` changed here; `saved` with what the
// server made of them; `said` words for the user; `lost` and `found` the server.
export class Desk extends EventTarget {
  dub = null;
  line = null;
  dragged = false; // whether something is: what is laid anew meanwhile would take it out of the hand
  curves = null;
  making = { running: false, words: "", dub: "" }; // the run of the finished dub
  before = {}; // by line, the take that was chosen before
  #undone = [];
  #done = [];
  #saving = Promise.resolve();
  #busy = 0;
  #stamp = 0; // another one since a save began or ended: what was asked for before is old
  #turn = 0;

  tell(kind, detail) { this.dispatchEvent(new CustomEvent(kind, { detail })); }

  async open(name) {
    this.#turn += 1;
    this.curves = null;
    this.#done = [];
    this.#undone = [];
    this.dub = await ask(dubPath(name));
    this.line = this.dub.lines[0];
    this.tell("dub");
    this.tell("line");
    this.#watch();
    await this.#listen();
  }

  // The sound and the curves of the recordings that are chosen now.
  async #listen() {
    const { name, heard } = this.dub;
    this.curves = null;
    try {
      const curves = await ask(`${dubPath(name)}/curves`);
      if (this.dub.name !== name || this.dub.heard !== heard) return;
      this.curves = { ...curves, words: {} };
      this.tell("curves");
      this.#align();
    } catch (error) { this.tell("said", error.message); }
  }

  choose(line) {
    if (!line || line === this.line) return;
    this.line = line;
    this.tell("line");
    this.#align();
  }

  #path({ cue }) { return `${dubPath(this.dub.name)}/lines/${encodeURIComponent(cue)}`; }

  // When the words of the chosen line are spoken.
  async #align() {
    const { line, curves } = this;
    if (!line.words || !curves || curves.words[line.cue]) return;
    curves.words[line.cue] = [];
    try {
      curves.words[line.cue] = await ask(`${this.#path(line)}/words`);
      this.tell("words");
    } catch (error) { this.tell("said", error.message); }
  }

  get canUndo() { return this.#done.length > 0; }
  get canRedo() { return this.#undone.length > 0; }

  // What is said once it is saved.
  change(line, part, words) {
    const [before, after] = [line.edit, { ...line.edit, ...part }];
    if (this.dub.fixed || same(before, after)) return;
    const step = { cue: line.cue, before, after };
    this.#done.push(step);
    this.#undone = [];
    this.#save(line, after, () => { this.#done = this.#done.filter((one) => one !== step); }, words);
  }

  // Keys that shut the mouth on the p, b and m of a line's words.
  async close(line) {
    this.tell("said", "Looking for p, b and m");
    try {
      const keys = await ask(`${this.#path(line)}/closures`);
      const count = keys.length - line.edit.keys.length;
      if (count) this.change(line, { keys }, `Saved: ${count} new key${count === 1 ? "" : "s"}`);
      else this.tell("said", "No new key is needed");
    } catch (error) { this.tell("said", error.message); }
  }

  // Make the finished dub, or stop that.
  async make() {
    try {
      this.making = await put(`${dubPath(this.dub.name)}/making`, { run: !this.making.running });
      this.tell("making");
    } catch (error) { this.tell("said", error.message); }
  }

  undo() { this.#step(this.#done, this.#undone, "before"); }
  redo() { this.#step(this.#undone, this.#done, "after"); }

  #step(from, to, which) {
    const step = from.pop();
    if (!step) return;
    to.push(step);
    const line = this.dub.lines.find(({ cue }) => cue === step.cue);
    this.choose(line);
    this.#save(line, step[which], () => { from.push(to.splice(to.indexOf(step), 1)[0]); });
  }

  // One after the other: each save names the revision that it changes.
  #save(line, edit, failed, words = "Saved") {
    const [name, cue, before] = [this.dub.name, line.cue, line.edit];
    line.edit = edit;
    this.#busy += 1;
    this.#stamp += 1;
    this.tell("edits");
    this.tell("said", "Saving");
    this.#saving = this.#saving.then(async () => {
      const path = `${dubPath(name)}/lines/${encodeURIComponent(cue)}`;
      try {
        this.#take(await put(path, { revision: this.dub.revision,
          edit: { ...edit, takes: line.takes } }), this.#busy > 1);
        this.tell("said", words);
      } catch (error) {
        failed();
        line.edit = before;
        if (error.status) await this.reload();
        else this.tell("lost");
        this.tell("edits");
        this.tell("said", `Not saved: ${error.status ? error.message : "the server does not answer"}`);
      } finally {
        this.#busy -= 1;
        this.#stamp += 1;
      }
    });
  }

  // What the server has; nothing where something is saved here meanwhile, which brings it, too.
  async reload(words = "") {
    const stamp = this.#stamp;
    try {
      const dub = await ask(dubPath(this.dub.name));
      if (stamp !== this.#stamp || (words && dub.revision === this.dub.revision)) return;
      this.#take(dub);
      if (words) this.tell("said", words);
    } catch (error) { this.tell("said", error.message); }
  }

  // Another state of the same dub; the chosen line stays chosen.
  #take(dub, unfinished = false) {
    if (dub.name !== this.dub?.name) return;
    if (unfinished) { this.dub.revision = dub.revision; return; }
    const chosen = this.line?.cue, heard = this.dub.heard === dub.heard;
    if (this.dub.frames !== dub.frames) this.#done = this.#undone = [];
    this.dub = dub;
    this.line = dub.lines.find(({ cue }) => cue === chosen) || dub.lines[0];
    if (!heard) this.#listen();
    this.tell("edits");
    this.tell("saved");
  }

  // Looks for what others saved. A connection that is kept open would be one of six, which all pages
  // of a browser share.
  async #watch() {
    const turn = this.#turn += 1;
    while (turn === this.#turn) {
      await new Promise((go) => setTimeout(go, LOOK_MS));
      const stamp = this.#stamp;
      try {
        const { revision, making } = await ask(`${dubPath(this.dub.name)}/revision`);
        const ended = this.making.running && !making.running;
        this.making = making;
        this.tell("found");
        this.tell("making");
        if (ended) await this.reload();
        if (turn === this.#turn && stamp === this.#stamp && !this.#busy && revision !== this.dub.revision) await this.reload(ELSEWHERE);
      } catch (error) {
        this.tell("lost", error.status && error.message);
      }
    }
  }
}
