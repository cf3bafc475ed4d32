"""Rendering a person's head for every frame of new speech, in segments that survive a kill."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from dfrf import checkpoint, saved_models
from dfrf import device as devices
from dfrf.method_interface import FrameInputs, Maps
from dfrf.model_interface import HeadModel
from dfrf.presets import method_of
from dubbing.compositing.face_mask import rendered_region
from dubbing.compositing.lip_colour import SAME, with_lip_colour
from dubbing.engine.disk.pieces import Pieces
from dubbing.engine.graph.stage import Progress
from dubbing.errors import CheckpointError
from dubbing.heads.frame_inputs import SpeechPart, head_inputs, inputs_of, made_of
from dubbing.heads.shown_lips import shown_lips
from dubbing.identity.lip_scale import Scale
from dubbing.media import VideoWriter, read_frames
from dubbing.preparation.crops.threads import in_order
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames


def load(model: Path, device: str = "auto") -> tuple[HeadModel, Maps | None, dict[str, object]]:
    """A person's model on a device with its reference maps, computed once; and its header.

    Raises:
        CheckpointError: the file cannot be used.
    """
    try:
        person, views, header = saved_models.load_person(model)
    except checkpoint.CheckpointError as error:
        raise CheckpointError(str(error), remedy="run with --force finetune") from error
    target = devices.choose(device)
    person.to(target).eval()
    maps = None if views is None else method_of(person).maps(views)
    return person, maps, header


def render(
    model: Path,
    clip: PreparedClip,
    speech: SpeechPart,
    out: Path,
    *,
    pose_index: np.ndarray,
    part: tuple[int, int] | None = None,
    baked: bool = False,
    strength: np.ndarray | None = None,
    lips: np.ndarray | None = None,
    scale: Scale | None = None,
    device: str = "auto",
    progress: Progress | None = None,
    made_by: str = "",
    last: Path | None = None,
) -> None:
    """Writes OUT/000000.mkv, OUT/000050.mkv ...: premultiplied colour and opacity (FFV1 RGBA).

    Of each head there is what the dub shows of it; see `dubbing.compositing.face_mask`.

    A file appears only when it is whole, and one that is there is not rendered again. It holds
    `dfrf.method_interface.Method.segment` frames: of a slow preset every single one is kept.

    Args:
        model: of the person, written by `finetune`.
        clip: whose poses are taken, refined with the model; see `refine_poses`.
        speech: of the frames to render; called for a segment at a time.
        out: folder.
        pose_index: (T,) frame of the clip each frame takes its pose from.
        part: first and stop of those of the T frames to render; all by default.
        baked: whether its baked density is looked up, where the model has one; else rays march.
        strength: (T,) of the opening that is seen; see `LipScale.shares`.
        lips: (T, L); see `dfrf.method_interface.FrameInputs`.
        scale: of the person's lips.
        device: auto, cpu or cuda.
        made_by: digest of the model and of the code.
        last: folder of the last result: its frames are taken that are made of the same.

    Raises:
        CheckpointError: the model cannot be used.
    """
    count = len(pose_index)
    person, maps, _ = load(model, device)
    out.mkdir(parents=True, exist_ok=True)

    begin, end = part or (0, count)

    def notify(done: int) -> None:
        if progress is not None:
            progress(f"frame {done} of {count}", (done - begin) / (end - begin))

    pieces = Pieces(out, last, made_by)
    segment = method_of(person).segment
    for first in range(begin, end, segment):
        stop = min(first + segment, end)
        path = out / f"{first:06d}.mkv"
        if not path.exists():
            span = (first, stop, baked, strength, lips, scale)
            inputs = head_inputs(person, clip, speech, pose_index, *span)
            poses = pose_index[first:stop]
            kept = pieces.same(path.name, made_of(inputs, clip, poses))
            if all(kept):
                pieces.copy(path.name)
            else:
                heads = heads_of(person, maps, inputs, clip, poses, ~np.array(kept))
                if any(kept) and pieces.last is not None:
                    heads = _with_kept(heads, kept, pieces.last / path.name)
                with VideoWriter(path, clip.size, clip.size, clip.rate, "ffv1-rgba") as video:
                    for done, head in enumerate(heads, first + 1):
                        video.write(head)
                        notify(done)
        notify(stop)


def heads_of(
    person: HeadModel,
    maps: Maps | None,
    inputs: FrameInputs,
    clip: PreparedClip,
    poses: np.ndarray,
    wanted: np.ndarray | None = None,
) -> Iterator[np.ndarray]:
    """Heads (S, S, 4) uint8 of F frames, over frames `poses` (F,) of a clip; see `render`.

    Those that are not `wanted` (F,) are blank; the speech codes of all of them are computed, so
    that the others do not depend on how many these are.
    """
    colours = np.tile(SAME, (len(poses), 1)) if clip.lip_colour is None else clip.lip_colour[poses]
    lips = shown_lips(person, maps, inputs) if colours.any() else None
    shown = np.zeros((len(poses), clip.size, clip.size), bool)
    some = slice(None) if wanted is None else wanted
    shown[some] = regions_of(clip, poses[some])
    regions = torch.from_numpy(shown).to(person.device)
    rendered = method_of(person).render_frames(replace(inputs, regions=regions), maps)
    blank = np.zeros((clip.size, clip.size, 4), np.uint8)
    for k, (colour, opacity) in enumerate(rendered):
        if wanted is not None and not wanted[k]:
            yield blank
            continue
        head = to_rgba(colour, opacity)
        yield head if lips is None else with_lip_colour(head, lips[k], colours[k])


def _with_kept(
    heads: Iterator[np.ndarray], kept: Sequence[bool], file: Path
) -> Iterator[np.ndarray]:
    """Heads of F frames; those that are `kept` are those of a file."""
    for head, same, old in zip(heads, kept, read_frames(file, pixels="rgba"), strict=True):
        yield old if same else head


def frames(
    model: HeadModel,
    maps: Maps | None,
    clip: PreparedClip,
    speech: SpeechFrames,
    pose_index: np.ndarray,
    first: int,
    stop: int,
    regions: np.ndarray | None = None,
    baked: bool = False,
) -> Iterator[tuple[Tensor, Tensor]]:
    """Colour (S, S, 3), premultiplied, and opacity (S, S) of frames first .. stop.

    Of the whole head, or of what of it lies in regions (stop - first, S, S) bool at least.
    """
    needed = None if regions is None else torch.from_numpy(regions).to(model.device)
    inputs = inputs_of(model, clip, speech, pose_index, first, stop)
    yield from method_of(model).render_frames(replace(inputs, regions=needed, baked=baked), maps)


def regions_of(clip: PreparedClip, poses: np.ndarray) -> np.ndarray:
    """Pixels of heads that a dub shows over frames `poses` (F,): (F, S, S) bool.

    None where no face is seen.
    """
    regions = np.zeros((len(poses), clip.size, clip.size), bool)
    shown = clip.valid[poses]
    jobs = ((landmarks, clip.size) for landmarks in clip.landmarks[poses[shown]])
    for k, region in zip(np.flatnonzero(shown), in_order(rendered_region, jobs), strict=True):
        regions[k] = region
    return regions


def to_rgba(colour: Tensor, opacity: Tensor) -> np.ndarray:
    """(S, S, 4) uint8 from premultiplied colour and opacity in 0..1."""
    both = torch.cat([colour, opacity[..., None]], -1).float()
    # In place: new memory for each step takes three times as long as the steps.
    return both.mul_(255).round_().clamp_(0, 255).to(torch.uint8).cpu().numpy()
