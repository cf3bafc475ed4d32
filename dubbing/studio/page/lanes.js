// The lines as blocks, the words of the chosen one, and parts with the film's own mouth: all can be dragged.

import { drag, seen } from "./moving.js";

const LONGEST_SHIFT = 500; // ms
const find = (id) => document.getElementById(id);
export const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
export const rounded = (value, step) => Number((Math.round(value / step) * step).toFixed(3));
const overlap = (one, other) => one.start < other.end - 0.001 && other.start < one.end - 0.001;

export class Lanes {
  constructor(desk) { this.desk = desk; }

  // All of it, for seconds low .. high on so many px.
  lay(low, high, wide) {
    const { dub, line: chosen } = this.desk, held = document.activeElement?.dataset?.block;
    const scale = wide / (high - low);
    find("lane").replaceChildren(...dub.lines.filter(({ first, stop }) =>
      stop / dub.rate > low - 1 && first / dub.rate < high + 1).map((line) => {
      const block = document.createElement("button");
      block.dataset.block = line.cue;
      block.textContent = `${line.line} ${line.speaker || line.identity} ${line === chosen ? "" : line.words}`; // its words lie below
      block.setAttribute("aria-label", `Line ${line.line}, its mouth ${line.edit.shift} ms later`);
      if (line === chosen) block.setAttribute("aria-current", "true");
      block.style.width = `${(line.stop - line.first) / dub.rate * scale}px`;
      const place = (shift) => { block.style.left = `${(line.first / dub.rate - low + shift / 1000) * scale}px`; };
      place(line.edit.shift);
      let shift = line.edit.shift;
      drag(this.desk, block, (across) => {
        shift = clamp(Math.round(line.edit.shift + across / scale * 1000), -LONGEST_SHIFT, LONGEST_SHIFT);
        place(shift);
        this.desk.tell("said", `the mouth ${shift} ms later`);
      }, (moved) => { this.desk.choose(line); if (moved) this.desk.change(line, { shift }); });
      block.addEventListener("click", () => this.desk.choose(line));
      block.addEventListener("keydown", (event) => {
        const step = { ArrowLeft: -10, ArrowRight: 10 }[event.key];
        if (!step) return;
        event.preventDefault();
        this.desk.change(line, { shift: clamp(line.edit.shift + step, -LONGEST_SHIFT, LONGEST_SHIFT) });
      });
      return block;
    }), ...this.#spans(low, scale), ...this.#ends(low, scale));
    find("spoken").hidden = !chosen.words && !chosen.edit.moved.length; // of words, before they are known
    find("spoken").replaceChildren(...this.#words(low, scale));
    find("timeline").querySelector(`[data-block="${CSS.escape(held || "")}"]`)?.focus();
  }

  // The words of the chosen line where they are seen, and other parts that are moved.
  #words(low, scale) {
    const { line, curves } = this.desk, words = curves.words[line.cue] || [];
    const others = line.edit.moved.filter((part) => part.start && part.end < line.seconds - 0.01 &&
      !words.some((word) => overlap(word, part)));
    return [...words, ...others].map((part, number) => {
      const word = this.#movable(part, `word ${number}`, part.text || `${part.start} to ${part.end} s`, low, scale);
      word.textContent = part.text || "";
      word.style.width = `${(seen(this.desk, line, part.end) - seen(this.desk, line, part.start)) * scale}px`;
      return word;
    });
  }

  // Both ends of the chosen line's block: its first and its last frame.
  #ends(low, scale) {
    const { dub, line: { seconds } } = this.desk, frame = rounded(1 / dub.rate, 0.01), last = rounded(seconds, 0.01);
    return [["begin", { start: 0, end: frame }], ["end", { start: rounded(last - frame, 0.01), end: last }]].map(([name, part]) => {
      const end = this.#movable(part, name, `${name} of the line`, low, scale);
      end.classList.add("end");
      return end;
    });
  }

  // A button that moves a part of the chosen line, or the moved part that it is in.
  #movable(part, block, name, low, scale) {
    const { dub, line } = this.desk, { moved } = line.edit;
    const own = moved.find((one) => overlap(one, part)) || { start: part.start, end: part.end, shift: 0 };
    const tag = document.createElement("button");
    tag.dataset.block = block;
    tag.classList.toggle("moved", own.shift !== 0);
    tag.disabled = dub.fixed;
    tag.setAttribute("aria-label", `${name}, its mouth ${own.shift} ms later`);
    const left = (seen(this.desk, line, block === "end" ? part.end : part.start) - low) * scale;
    tag.style.left = `${left}px`;
    const at = (by) => clamp(Math.round(own.shift + by), -LONGEST_SHIFT, LONGEST_SHIFT);
    const change = (shift) => this.desk.change(line, { moved: [...moved.filter((one) => one !== own),
      ...(shift ? [{ ...own, shift }] : [])].sort((a, b) => a.start - b.start) });
    let shift = own.shift;
    drag(this.desk, tag, (across) => {
      shift = at(across / scale * 1000);
      tag.style.left = `${left + (shift - own.shift) / 1000 * scale}px`;
      this.desk.tell("said", `its mouth ${shift} ms later`);
    }, (did) => { if (did) change(shift); });
    tag.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -10, ArrowRight: 10, Delete: -own.shift, Backspace: -own.shift }[event.key];
      if (step === undefined) return;
      event.preventDefault();
      change(at(step));
    });
    return tag;
  }

  // Parts of the chosen line with the film's own mouth, and a handle at both ends of each.
  #spans(low, scale) {
    const { dub, line } = this.desk, { film_mouth: spans } = line.edit, begin = line.first / dub.rate - low;
    return spans.flatMap((span, number) => {
      const part = document.createElement("div");
      part.className = "own";
      const lay = ({ start, end }) => {
        part.style.left = `${(begin + start) * scale}px`;
        part.style.width = `${(end - start) * scale}px`;
      };
      lay(span);
      const others = (one) => spans.flatMap((old, k) => (k === number ? one : old));
      return [part, ...["start", "end"].map((side) => {
        const handle = document.createElement("button"), [least, most] = side === "start"
          ? [0, span.end - 1 / dub.rate] : [span.start + 1 / dub.rate, Math.max(line.seconds, span.end)];
        const moved = (by) => ({ ...span, [side]: rounded(clamp(span[side] + by, least, most), 0.01) });
        const place = (one) => { handle.style.left = `${(begin + one[side]) * scale}px`; };
        let one = span;
        handle.className = "edge";
        handle.dataset.block = `${number} ${side}`;
        handle.disabled = dub.fixed;
        handle.setAttribute("aria-label", `Film's own mouth, ${side} at ${span[side]} s`);
        place(span);
        drag(this.desk, handle, (across) => { one = moved(across / scale); place(one); lay(one); },
          (did) => { if (did) this.desk.change(line, { film_mouth: others(one) }); });
        handle.addEventListener("keydown", ({ key }) => {
          const step = { ArrowLeft: -1, ArrowRight: 1 }[key];
          if (step) this.desk.change(line, { film_mouth: others(moved(step / dub.rate)) });
          if (key === "Delete" || key === "Backspace") this.desk.change(line, { film_mouth: others([]) });
        });
        return handle;
      })];
    });
  }
}
