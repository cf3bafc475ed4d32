// What moves: the mouth of a line against its sound, and what is dragged.

const times = ({ dub }, line) => line.moments.map((_, k) => (line.first + k + 0.5) / dub.rate);
// Second of the dub at which a second of a line's sound is seen, and back.
export const seen = (desk, line, at) => between(at, line.moments, times(desk, line));
export const heardAt = (desk, line, time) => between(time, times(desk, line), line.moments);

// The value at x of a curve through points whose xs rise; beyond both ends it goes on one to one.
function between(x, xs, ys) {
  const k = xs.findIndex((one) => one >= x);
  if (k < 1) return k ? ys.at(-1) + x - xs.at(-1) : ys[0] + x - xs[0];
  return ys[k - 1] + (x - xs[k - 1]) / (xs[k] - xs[k - 1]) * (ys[k] - ys[k - 1]);
}

// Calls `moved(across, down)` in px while something is dragged, and `ended(whether it moved)`.
export function drag(desk, tag, moved, ended) {
  tag.addEventListener("pointerdown", (down) => {
    if (down.button || tag.disabled) return;
    tag.setPointerCapture(down.pointerId);
    let far = false;
    const over = new AbortController(), { signal } = over;
    const move = (event) => {
      const [across, below] = [event.clientX - down.clientX, event.clientY - down.clientY];
      far ||= Math.hypot(across, below) > 2;
      if (far) moved(across, below);
    };
    const end = ({ type }) => {
      over.abort();
      desk.dragged = false;
      ended(far && type === "pointerup");
      desk.tell("dropped");
    };
    desk.dragged = true;
    document.addEventListener("pointermove", move, { signal });
    for (const kind of ["pointerup", "pointercancel"]) document.addEventListener(kind, end, { signal });
  });
}
