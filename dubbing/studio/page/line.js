// The chosen line as a form, and the list of all lines.

import { AS_SPOKEN } from "./desk.js";

// What of an edit each take has of its own.
const ofTake = ({ shift, strength, style, keys, curves, film_mouth, moved, audio }) =>
  ({ shift, strength, style, keys, curves, film_mouth, moved, audio });

const VERDICTS = { pass: "in sync", warn: "look closely", fail: "failed", unjudged: "not judged" };
const find = (id) => document.getElementById(id);

export class LineForm {
  constructor(desk) {
    this.desk = desk;
    this.form = find("line");
    const { strength, shift, film, moved, note, status } = this.form.elements;
    strength.addEventListener("input", () => { find("strong").textContent = strength.value; });
    const change = (part) => this.desk.change(this.desk.line, part);
    strength.addEventListener("change", () => change({ strength: Number(strength.value) }));
    shift.addEventListener("change", () => shift.reportValidity() && change({ shift: Number(shift.value) }));
    for (const [field, name] of [[film, "film_mouth"], [moved, "moved"]]) {
      field.addEventListener("change", () => {
        const found = [...field.value.matchAll(/([\d.]+)\s*-\s*([\d.]+)(?:\s+(-?\d+))?/g)];
        const parts = found.map(([, start, end, by]) => ({ start: Number(start), end: Number(end),
          ...(field === moved ? { shift: Number(by) } : {}) }));
        field.setCustomValidity(parts.every(({ start, end }) => start < end) ? "" : "From the earlier to the later second");
        if (field.reportValidity()) change({ [name]: parts });
      });
    }
    note.addEventListener("change", () => change({ note: note.value }));
    this.form.elements.style.addEventListener("change", ({ target }) => change({ style: target.value }));
    for (const one of status) one.addEventListener("change", () => change({ status: one.value }));
    this.form.elements.take.addEventListener("change", ({ target }) => this.take(target.value));
    find("labials").addEventListener("click", () => this.desk.close(this.desk.line));
    find("keep").addEventListener("click", () => this.keep());
    find("reset").addEventListener("click", () => {
      const { note: words, status: as, take } = this.desk.line.edit;
      change({ ...AS_SPOKEN, note: words, status: as, take });
    });
    find("next").addEventListener("click", () => this.next());
    this.form.addEventListener("submit", (event) => event.preventDefault());
    for (const kind of ["line", "edits", "saved"]) desk.addEventListener(kind, () => this.lay());
  }

  // The edit as it is now under a name of its own, chosen: what is changed from here on is changed in it.
  keep() {
    const { line } = this.desk;
    let number = 1;
    while (line.takes[number]) number += 1;
    line.takes = { ...line.takes, [line.edit.take]: ofTake(line.edit) };
    this.desk.change(line, { take: String(number) });
  }

  // Another version of the edit; the one before stays under its name.
  take(name) {
    const { line } = this.desk, { take } = line.edit;
    line.takes = { ...line.takes, [take]: ofTake(line.edit) };
    this.desk.before[line.cue] = take;
    this.desk.change(line, { take: name, ...ofTake({ ...AS_SPOKEN, ...line.takes[name] }) });
  }

  // Back and forth between two takes.
  swap() {
    const { line } = this.desk, names = Object.keys(line.takes), { take } = line.edit;
    const other = this.desk.before[line.cue] ?? names.find((name) => name !== take);
    if (other === undefined || other === take) this.desk.tell("said", "This line has one take");
    else this.take(other);
  }

  // The next line that nobody has decided about, from the chosen one on and round.
  next() {
    const { lines } = this.desk.dub, place = lines.indexOf(this.desk.line);
    const round = [...lines.slice(place + 1), ...lines.slice(0, place)];
    const line = round.find(({ edit }) => edit.status === "open");
    if (line) this.desk.choose(line);
    else this.desk.tell("said", "No other line is open");
  }

  beside(step) {
    const { lines } = this.desk.dub;
    this.desk.choose(lines[lines.indexOf(this.desk.line) + step]);
  }

  lay() {
    const { dub, line } = this.desk, { edit } = line, { elements } = this.form;
    find("title").textContent = `Line ${line.line} · ${line.speaker || line.identity} · ${line.in}`;
    find("words").textContent = line.words;
    find("verdict").textContent = VERDICTS[line.verdict] || "not checked";
    find("verdict").className = `tag ${line.verdict || ""}`;
    find("reason").textContent = line.reason || "";
    find("fields").disabled = dub.fixed;
    find("labials").disabled = !line.words;
    const names = [...new Set(["", ...Object.keys(line.takes), edit.take])];
    find("takes").hidden = names.length < 2;
    elements.take.replaceChildren(...names.map((name) => {
      const verdict = VERDICTS[line.verdicts[name]];
      return new Option([name || "without a name", verdict].filter(Boolean).join(" · "), name);
    }));
    elements.take.value = edit.take;
    elements.strength.value = edit.strength;
    find("strong").textContent = edit.strength;
    elements.style.value = edit.style;
    elements.shift.value = edit.shift;
    if (document.activeElement !== elements.film)
      elements.film.value = edit.film_mouth.map(({ start, end }) => `${start}-${end}`).join(", ");
    if (document.activeElement !== elements.moved)
      elements.moved.value = edit.moved.map(({ start, end, shift }) => `${start}-${end} ${shift}`).join(", ");
    if (document.activeElement !== elements.note) elements.note.value = edit.note;
    elements.status.value = edit.status;
    this.#keys(line);
    this.#list();
    const count = (status) => dub.lines.filter((one) => one.edit.status === status).length;
    find("counts").textContent = `${dub.lines.length} line${dub.lines.length === 1 ? "" : "s"}: ` +
      ["open", "approved", "redo"].map((status) => `${count(status)} ${status}`).join(", ");
  }

  #keys(line) {
    const held = [...find("keys").children].indexOf(document.activeElement);
    const number = (key, name, place, most, step) => {
      const input = document.createElement("input");
      Object.assign(input, { type: "number", min: 0, max: most, step, value: key[name] });
      input.setAttribute("aria-label", `${name === "at" ? "Second" : "Strength"} of key ${place + 1}`);
      input.addEventListener("change", () => {
        if (!input.reportValidity()) return;
        const keys = line.edit.keys.map((one, k) => k === place ? { ...one, [name]: Number(input.value) } : one);
        this.desk.change(line, { keys: keys.sort((a, b) => a.at - b.at) });
      });
      return input;
    };
    const heads = line.edit.keys.length ? ["Key at, s", "Strength", ""] : [];
    find("keys").replaceChildren(...heads.map((words) => Object.assign(document.createElement("span"), { textContent: words })),
      ...line.edit.keys.flatMap((key, place) => {
      const remove = document.createElement("button");
      Object.assign(remove, { type: "button", textContent: "×" });
      remove.setAttribute("aria-label", `Remove key ${place + 1}`);
      remove.addEventListener("click", () =>
        this.desk.change(line, { keys: line.edit.keys.filter((_, k) => k !== place) }));
      return [number(key, "at", place, Math.floor(line.seconds * 100) / 100, 0.01),
        number(key, "strength", place, 1.5, 0.05), remove];
    }));
    find("keys").children[held]?.focus();
  }

  #list() {
    const { dub, line: chosen } = this.desk, nav = find("lines");
    const held = nav.contains(document.activeElement);
    nav.replaceChildren(...dub.lines.map((line) => {
      const button = document.createElement("button"), parts = ["", "said", "tag"].map((name) => {
        const part = document.createElement("span");
        part.className = name;
        return part;
      });
      parts[0].textContent = line.line;
      parts[1].textContent = [line.speaker || line.identity, line.words].filter(Boolean).join(": ");
      const { edit } = line, edited = edit.shift || edit.strength !== 1 || edit.style !== AS_SPOKEN.style || edit.keys.length || edit.film_mouth.length || edit.moved.length;
      parts[2].textContent = edit.status === "open" ? (edited ? "edited" : "") : edit.status;
      parts[2].classList.add(edit.status);
      button.append(...parts);
      if (line === chosen) button.setAttribute("aria-current", "true");
      button.addEventListener("click", () => this.desk.choose(line));
      return button;
    }));
    const current = nav.querySelector("[aria-current]");
    if (held) current?.focus();
    if (current) nav.scrollTop = Math.max(0, current.offsetTop - nav.offsetTop - nav.clientHeight / 2);
  }
}
