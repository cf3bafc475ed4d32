"""Lip sync of a rendered clip beside that of its source."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dubbing import media
from dubbing.identity.best_seconds import Part
from dubbing.preparation.prepared import PreparedClip
from dubbing.provenance import provenance
from dubbing.sync.check import check
from dubbing.sync.result import SyncResult


def sync_figures(clip: PreparedClip, out: Path, part: Part) -> dict[str, Any]:
    """Lip sync of OUT/render_picture.mp4 and of the source beside it, once they have their sound.

    Args:
        part: frames of the clip that were spoken in them.
    """
    start, length = (float(frames / clip.rate) for frames in part)
    checks: dict[str, SyncResult] = {}
    for kind in ("source", "render"):
        video = out / f"{kind}.mp4"
        silent = out / f"{kind}_picture.mp4"
        media.mux(
            silent,
            clip.clip,
            video,
            audio_start=start,
            seconds=length,
            metadata=provenance.tags() if kind == "render" else None,
        )
        silent.unlink()
        checks[kind] = check(video, source=checks.get("source"))
    render, source = checks["render"], checks["source"]
    return {
        "offset_frames": render.offset_frames,
        "confidence": render.confidence,
        "closeness": render.closeness,
        "source_offset_frames": source.offset_frames,
        "source_confidence": source.confidence,
    }
