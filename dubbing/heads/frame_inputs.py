"""Inputs of the heads of a dub: poses, speech, and what an edit says of the lips."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from dfrf.data.dataset import neighbour_windows
from dfrf.field.audio import NEIGHBOURS
from dfrf.field.conditioning import Conditioning
from dfrf.field.speaker_adaptation import OPENING
from dfrf.method_interface import FrameInputs
from dfrf.model_interface import HeadModel
from dfrf.presets import method_of
from dubbing.engine.disk.files import digest_bytes
from dubbing.identity.dataset import upper_face_expression
from dubbing.identity.lip_scale import Scale
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames

# What is heard at `count` frames from `first` on.
SpeechPart = Callable[[int, int], SpeechFrames]


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
    """Inputs of the heads of frames first .. stop of a dub, but for regions; see `render`."""
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


def made_of(inputs: FrameInputs, clip: PreparedClip, poses: np.ndarray) -> list[list[object]]:
    """Plain data of each of F frames: the same for those that give the same heads of one model."""
    around = len(inputs.predicted_lips) - len(poses) + 1
    values = vars(inputs) | {
        "predicted_lips": inputs.predicted_lips.unfold(0, around, 1),
        "landmarks": clip.landmarks[poses],
        "valid": clip.valid[poses],
        "lip_colour": None if clip.lip_colour is None else clip.lip_colour[poses],
    }

    def plain(value: object, k: int) -> object:
        if isinstance(value, Tensor):
            value = value.cpu().numpy()
        if not isinstance(value, np.ndarray):
            return value
        return [str(value.dtype), [*value.shape], digest_bytes(value[k].tobytes())]

    return [[plain(value, k) for value in values.values()] for k in range(len(poses))]


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

    `strength` is (F,), `lips` (F, L + 1): see `dfrf.method_interface.FrameInputs`.
    """
    edit = [_on(values, model.device) for values in (strength, lips)]
    return _decided(model, speech, lambda own, *heard: own.lips(own.adapted_codes(*heard, *edit)))


def parted_lips(
    model: HeadModel, speech: SpeechFrames, lips: np.ndarray | None = None
) -> np.ndarray | None:
    """The same (F, L + 1) but for closures, and how far they are closed, 0..1."""
    given = _on(lips, model.device)
    return _decided(model, speech, lambda own, *heard: own.wanted_lips(*heard, given))


def _decided(
    model: HeadModel,
    speech: SpeechFrames,
    of: Callable[[Conditioning, Tensor, Tensor], Tensor],
) -> np.ndarray | None:
    """Answers of a model's conditioning for all frames of speech; None without lip measures."""
    own = getattr(getattr(model, "field", None), "conditioning", None)
    if own is None or not own.config.learns_lips:
        return None
    parts = _heard(speech, 0, len(speech), method_of(model).reach)
    with torch.no_grad():
        return np.asarray(of(own, *(part.to(model.device) for part in parts)).float().cpu())


def _on(values: np.ndarray | None, device: torch.device) -> Tensor | None:
    return None if values is None else torch.from_numpy(values).float().to(device)


def _heard(speech: SpeechFrames, first: int, stop: int, reach: int) -> tuple[Tensor, Tensor]:
    """Speech windows of the neighbours of frames first .. stop, and lips of `reach` more."""
    # Speech does not stop at a cut of the picture, so all frames count as one run.
    one_run, own = torch.zeros(len(speech)), torch.arange(first, stop)
    near = neighbour_windows(torch.from_numpy(speech.windows).float(), one_run, own)
    around = np.arange(first - reach, stop + reach).clip(0, len(speech) - 1)
    return near, torch.from_numpy(speech.lips[around]).float()
