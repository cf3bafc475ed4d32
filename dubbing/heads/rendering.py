"""Rendering a person's head for every frame of new speech, in segments that survive a kill."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from dfrf import checkpoint, saved_models
from dfrf import device as devices
from dfrf.data.dataset import neighbour_windows
from dfrf.field.audio import NEIGHBOURS
from dfrf.field.speaker_adaptation import OPENING
from dfrf.method_interface import FrameInputs, Maps
from dfrf.model_interface import HeadModel
from dfrf.presets import method_of
from dubbing.compositing.face_mask import rendered_region
from dubbing.engine.disk.files import digest_bytes, digest_data
from dubbing.engine.disk.pieces import Pieces
from dubbing.engine.graph.stage import Progress
from dubbing.errors import CheckpointError
from dubbing.identity.dataset import upper_face_expression
from dubbing.identity.lip_scale import Scale
from dubbing.media import VideoWriter
from dubbing.preparation.crops.threads import in_order
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames

# What is heard at `count` frames from `first` on.
SpeechPart = Callable[[int, int], SpeechFrames]


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
        progress: called with a message and the share done.
        made_by: digest of the model and of the code.
        last: folder of the last result: files whose frames are made of the same are copied.

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
            seen = [digest_bytes(of[poses].tobytes()) for of in (clip.landmarks, clip.valid)]
            if not pieces.take(path.name, [digest_of_inputs(inputs), *seen]):
                with VideoWriter(path, clip.size, clip.size, clip.rate, "ffv1-rgba") as video:
                    heads = heads_of(person, maps, inputs, clip, poses)
                    for done, head in enumerate(heads, first + 1):
                        video.write(head)
                        notify(done)
        notify(stop)


def heads_of(
    person: HeadModel, maps: Maps | None, inputs: FrameInputs, clip: PreparedClip, poses: np.ndarray
) -> Iterator[np.ndarray]:
    """Heads (S, S, 4) uint8 of F frames, over frames `poses` (F,) of a clip; see `render`."""
    regions = torch.from_numpy(regions_of(clip, poses)).to(person.device)
    for colour, opacity in method_of(person).render_frames(replace(inputs, regions=regions), maps):
        yield to_rgba(colour, opacity)


def head_inputs(
    person: HeadModel,
    clip: PreparedClip,
    speech: SpeechPart,
    pose_index: np.ndarray,
    first: int,
    stop: int,
    baked: bool,
    strength: np.ndarray | None,
    lips: np.ndarray | None,
    scale: Scale | None = None,
) -> FrameInputs:
    """Inputs of the heads of frames first .. stop of a dub, but for their regions; see `render`."""
    around = NEIGHBOURS // 2 + method_of(person).reach  # frames that its speech codes look at
    low, high = max(0, first - around), min(len(pose_index), stop + around)
    heard, poses = speech(low, high - low), pose_index[low:high]
    strength, lips = (None if one is None else one[low:high] for one in (strength, lips))
    shares = _shares(person, heard, strength, lips, scale)
    span = (first - low, stop - low)

    def own(values: np.ndarray | None) -> Tensor | None:
        return None if values is None else _on(values[slice(*span)], person.device)

    return replace(
        inputs_of(person, clip, heard, poses, *span),
        baked=baked,
        strength=own(shares),
        lips=own(lips),
    )


def digest_of_inputs(inputs: FrameInputs) -> str:
    """The same for inputs that give the same heads of one model."""
    return digest_data({name: plain(value) for name, value in vars(inputs).items()})


def plain(value: object) -> object:
    """A tensor as plain data; other values as they are."""
    if not isinstance(value, Tensor):
        return value
    return [str(value.dtype), [*value.shape], digest_bytes(value.cpu().numpy().tobytes())]


def _shares(
    person: HeadModel,
    speech: SpeechFrames,
    strength: np.ndarray | None,
    lips: np.ndarray | None,
    scale: Scale | None,
) -> np.ndarray | None:
    """How far the lips leave the closed mouth in F frames, (F,), so that `strength` is seen."""
    if scale is None or strength is None or not ((strength > 0) & (strength < 1)).any():
        return strength
    spoken = wanted_lips(person, speech, lips=lips)
    closed = wanted_lips(person, speech, np.zeros_like(strength))
    if spoken is None or closed is None:
        return strength
    return scale().shares(strength, spoken[:, OPENING], float(closed[0, OPENING]))


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


def inputs_of(
    model: HeadModel,
    clip: PreparedClip,
    speech: SpeechFrames,
    pose_index: np.ndarray,
    first: int,
    stop: int,
) -> FrameInputs:
    """Inputs of frames first .. stop, on the model's device: whole heads, marched, as spoken."""
    device, reach = model.device, method_of(model).reach
    near, predicted = _heard(speech, first, stop, reach)
    poses = pose_index[first:stop]
    return FrameInputs(
        torch.from_numpy(clip.c2w()[poses]).float().to(device),
        float(clip.focal),
        torch.from_numpy(clip.centre[poses]).float().to(device),
        near.to(device),
        predicted.to(device),
        torch.from_numpy(upper_face_expression(clip)[poses]).float().to(device),
        clip.size,
    )


def wanted_lips(
    model: HeadModel,
    speech: SpeechFrames,
    strength: np.ndarray | None = None,
    lips: np.ndarray | None = None,
) -> np.ndarray | None:
    """Lip measures (F, L) that a model wants in F frames of speech; None where it has none.

    `strength` is (F,), `lips` (F, L): see `dfrf.method_interface.FrameInputs`.
    """
    own = getattr(getattr(model, "field", None), "conditioning", None)
    if own is None or not own.config.learns_lips:
        return None
    parts = _heard(speech, 0, len(speech), method_of(model).reach)
    with torch.no_grad():
        near, predicted = (part.to(model.device) for part in parts)
        edit = (_on(values, model.device) for values in (strength, lips))
        return np.asarray(own.lips(own.adapted_codes(near, predicted, *edit)).float().cpu())


def _on(values: np.ndarray | None, device: torch.device) -> Tensor | None:
    return None if values is None else torch.from_numpy(values).float().to(device)


def _heard(speech: SpeechFrames, first: int, stop: int, reach: int) -> tuple[Tensor, Tensor]:
    """Speech windows of the neighbours of frames first .. stop, and lips of `reach` more."""
    # Speech does not stop at a cut of the picture, so all frames count as one run.
    one_run, own = torch.zeros(len(speech)), torch.arange(first, stop)
    near = neighbour_windows(torch.from_numpy(speech.windows).float(), one_run, own)
    around = np.arange(first - reach, stop + reach).clip(0, len(speech) - 1)
    return near, torch.from_numpy(speech.lips[around]).float()


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
    return (both.clamp(0, 1) * 255).round().to(torch.uint8).cpu().numpy()
