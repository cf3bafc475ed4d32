"""Checks of bases for `plan`, and of people with the `paper` preset: it is slow, and what
it starts from. Loads no torch.
"""

from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open

from dfrf.config import FORMATS, PUBLISHED_SPEECH, STEPS, family
from dubbing.engine.disk import json_records
from dubbing.errors import ExplainedError
from dubbing.manifest.keys.identity_entry import Identity
from dubbing.script.timeline import frame_count
from dubbing.shipped.base import shipped_base
from dubbing.speech import features
from dubbing.stages.finetune import PAPER_FEATURES_SECONDS, PAPER_RAYS_SECONDS
from dubbing.stages.render import PAPER_FRAME_SECONDS

PRESET = "paper"
SIZE = 512  # px, of the published clips
HOUR, DAY = 3600.0, 86400.0


def base_header(base: Path) -> dict[str, Any]:
    """The header of a checkpoint; empty where it cannot be read."""
    try:
        with safe_open(str(base), framework="numpy") as file:
            text = (file.metadata() or {}).get("dfrf", "{}")
        return json_records.parse(text, dict[str, Any], "header", str(base), "name another base")
    except (OSError, SafetensorError, ExplainedError):
        return {}


def base_problem(identity: Identity) -> str | None:
    """Why the base that an identity names cannot be its start; None where that is not known."""
    if identity.base is None:
        return None
    kinds = {name: kind for kind, name in FORMATS.items()}
    kind = kinds.get(str(base_header(identity.base).get("format")))
    if kind is None or kind == family(identity.preset):
        return None
    return f"is a base of preset {kind!r}, but the identity has preset {identity.preset!r}"


def speech_problem(identity: Identity) -> str | None:
    """Why somebody cannot be learned from their base: it was trained to hear something else."""
    base = identity.base or shipped_base(identity.preset)
    if base is None:
        return None
    header = base_header(base)
    heard, weights = header.get("speech"), header.get("speech_digest")
    if heard is None or (heard == PUBLISHED_SPEECH and weights is None):
        return None
    what = "the base that comes with this tool" if identity.base is None else base.name
    remedy = (
        f"name a base of {identity.speech}, which dfrf train-base makes, or set speech: {heard}"
    )
    if heard != identity.speech:
        return f"{what} hears {heard}, but the identity has speech: {identity.speech}: {remedy}"
    with suppress(ExplainedError, OSError):  # weights that are not there are reported as such
        if weights != (features.fingerprint(identity.speech, identity.speech_weights) or None):
            return f"{what} was trained with other weights of {heard}: {remedy}"
    return None


def identity_notes(identity: Identity) -> list[str]:
    """Notes on the time that learning a person takes, and on its start."""
    if identity.preset != PRESET:
        return []
    steps = identity.finetune.iterations or STEPS[PRESET]
    each = PAPER_RAYS_SECONDS + PAPER_FEATURES_SECONDS * (crop_side(identity) / SIZE) ** 2
    notes = [f"preset {PRESET} learns {steps} steps in {lasts(steps * each)}"]
    if identity.base is None:
        notes.append(
            f"no base of preset {PRESET} comes with this tool, so learning starts from random"
            " weights; dfrf train-base makes one, dfrf import-checkpoint reads a published one"
        )
    elif identity.speech != base_header(identity.base).get("speech") == PUBLISHED_SPEECH:
        notes.append(
            f"{identity.base.name} heard DeepSpeech features: the layer of its AudioNet that reads"
            f" them is learned anew, from {identity.speech} features; with speech: deepspeech, and"
            " speech_weights: your output_graph.pb, it hears what it was trained on"
        )
    return notes


def dub_note(name: str, identity: Identity, rate: Fraction, seconds: float) -> str | None:
    """How long the heads of a dub take, `rate` frames a second; None for other presets."""
    if identity.preset != PRESET:
        return None
    frames = frame_count(seconds, rate)
    each = PAPER_FRAME_SECONDS * (crop_side(identity) / SIZE) ** 2
    return f"{name}: preset {PRESET} renders {frames} frames in {lasts(frames * each)}"


def crop_side(identity: Identity) -> int:
    """Px of the head crop's side that times are told for, as far as the manifest says it."""
    return identity.size if "size" in identity.model_fields_set else SIZE


def lasts(seconds: float) -> str:
    """A time in words, on the machine that it was measured on."""
    for unit, length in (("days", DAY), ("hours", HOUR)):
        if seconds >= 2 * length:
            return f"about {seconds / length:.0f} {unit} on two processor cores"
    return f"about {max(2, round(seconds / 60))} minutes on two processor cores"
