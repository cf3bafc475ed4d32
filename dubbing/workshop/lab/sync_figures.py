"""Lip sync of a rendered clip beside that of its source."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dubbing import media
from dubbing.identity.best_seconds import Part
from dubbing.preparation.prepared import PreparedClip
from dubbing.provenance import provenance
from dubbing.sync.check import check


def sync_figures(clip: PreparedClip, out: Path, part: Part) -> dict[str, Any]:
    """Lip sync of OUT/render_picture.mp4 and of the source beside it, once they have their sound.

    Args:
        part: frames of the clip that were spoken in them.
    """
    start, length = (float(frames / clip.rate) for frames in part)
    checks = {}
    for kind in ("render", "source"):
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
        checks[kind] = check(video)
    render, source = checks["render"], checks["source"]
    return {
        "offset_frames": render.offset_frames,
        "confidence": render.confidence,
        "source_offset_frames": source.offset_frames,
        "source_confidence": source.confidence,
        **suspicion(render.confidence, source.confidence),
    }


def suspicion(confidence: float | None, of_source: float | None) -> dict[str, Any]:
    """`suspicious`, and a sentence where a render fits its sound better than the person does.

    Lips that do what speech sounds like on average please a sync network more than real ones.
    """
    if confidence is None or of_source is None:
        return {}
    if confidence <= of_source:
        return {"suspicious": False}
    why = (
        f"sync confidence {confidence:.3f} is above the source's own {of_source:.3f}: "
        "no success, lips of the average please a sync network more than a person's own"
    )
    return {"suspicious": True, "suspicion": why}
