"""Stand-in versions of the same dubs: manifests, whose output folders hold small videos."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests import clips

PARTS = {"timing": 0.9, "sharpness": 0.8}
DUBS = ("it", "de", "fr", "es")


def write(folder: Path, names: tuple[str, ...] = DUBS, first_frames: int = 20) -> Path:
    """A manifest whose dubs are made; every video has another length."""
    folder.mkdir(parents=True)
    clips.write_clip(folder / "host.mp4", 30)
    clips.write_sound(folder / "speech.wav", 1)
    text = "version: 1\noutput: out\nidentities:\n  host: {clip: host.mp4, seconds: 1, consent: "
    text += clips.CONSENT + "}\ndubs:\n"
    for k, name in enumerate(names):
        text += f"  - {{name: {name}, identity: host, audio: speech.wav}}\n"
        (folder / "out").mkdir(exist_ok=True)
        clips.write_clip(folder / "out" / f"{name}.mp4", first_frames + k)
        check = {"closeness": 0.9, "parts": PARTS, "verdict": "pass"}
        (folder / "out" / f"{name}.sync.json").write_text(json.dumps(check))
    path = folder / "m.yaml"
    path.write_text(text)
    return path


def side(version: int, parts: dict[str, float], closeness: float | None = None) -> dict[str, Any]:
    return {"version": version, "video": "x.mp4", "closeness": closeness, "parts": parts}
