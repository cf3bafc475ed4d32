// The server: what it knows of a dub, and its frames.

export const dubPath = (name) => `/api/dubs/${encodeURIComponent(name)}`;

// The answer as an object; what went wrong in words, with its status.
export async function ask(path, options = {}) {
  const answer = await fetch(path, options);
  const text = await answer.text();
  let found;
  try { found = JSON.parse(text); } catch { found = { error: text }; }
  if (answer.ok) return found;
  throw Object.assign(new Error(found.error || answer.statusText), { status: answer.status });
}

export const put = (path, body) => ask(path, {
  method: "PUT", headers: { "content-type": "application/json" }, body: JSON.stringify(body),
});

// Calls `got(frame, mark, body)` for each frame as it comes, after `told(number of frames)`.
export async function frames(name, wanted, signal, told, got) {
  const answer = await fetch(`${dubPath(name)}/frames`, { method: "POST", signal,
    headers: { "content-type": "application/json" }, body: JSON.stringify(wanted) });
  if (!answer.ok) throw new Error((await answer.json()).error);
  told(Number(answer.headers.get("x-frames")));
  const reader = answer.body.getReader();
  let held = new Uint8Array();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    const joined = new Uint8Array(held.length + value.length);
    joined.set(held);
    joined.set(value, held.length);
    held = joined;
    while (held.length >= 8) {
      const view = new DataView(held.buffer, held.byteOffset);
      const [head, body] = [view.getUint32(0), view.getUint32(4)];
      if (held.length < 8 + head + body) break;
      const about = JSON.parse(new TextDecoder().decode(held.subarray(8, 8 + head)));
      if (about.error) throw new Error(about.error);
      got(about.frame, about.mark, held.slice(8 + head, 8 + head + body));
      held = held.subarray(8 + head + body);
    }
  }
}
