"""A clip of a person who does not exist, with the exact truth about every frame."""

import io
import tempfile
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import soundfile

from dubbing.engine.disk.files import atomic_path, atomic_write_bytes
from dubbing.engine.graph.stage import Progress
from dubbing.errors import ExplainedError
from dubbing.media import VideoWriter, mux
from dubbing.workshop.synthetic.anatomy.face import Face, face_by_name
from dubbing.workshop.synthetic.anatomy.lips import MouthShape
from dubbing.workshop.synthetic.motion import move
from dubbing.workshop.synthetic.rendering.render import REST_SHIFT, Renderer, State
from dubbing.workshop.synthetic.visemes import Phone, mouth_curves
from dubbing.workshop.synthetic.voice import synthesise

# Sentences for speakers that networks learn from.
TEXTS = (
    "The boat below the bridge moved slowly up the river, while five boys waved from the bank. "
    "We have been warm and dry all week; how was your weather?",
    "Please bring me a map, some bread, and a pound of plums. Thank you very much. "
    "She sells fresh fish from a shop by the shore, whatever the wind may do.",
    "Why would anyone borrow a blue umbrella on a bright day in May? "
    "My father thought about it, shook his head, and put both of them back.",
)
TAIL = 0.4  # seconds of silence after the last word without a requested length


@dataclass(frozen=True)
class SpeakerTruth:
    """Ground truth of each of the T frames of a clip of side S.

    rotation (T, 3, 3), translation (T, 3): OpenCV head pose, X_cam = R X + t, units of 10 cm,
    origin between the ears, outer eye corners 0.9 apart. A point is seen at pixel
    focal * (x, y) / z + centre, whole numbers being pixel centres. head, person (T, S, S) uint8:
    mattes of face, ears and hair, and of the whole body. background (S, S, 3) uint8: the image
    without head and neck. opening (T,): gap between the lips in the middle, units of 10 cm.
    mouth (T, 7): parameters in the order of `visemes.CHANNELS`. blink (T,): 0 open, 1 shut.
    phones: on the clock of the frames; in the file the sound comes offset_frames / rate seconds
    earlier than the mouth shows it (positive: the audio is early).
    """

    rate: Fraction
    focal: float
    centre: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray
    head: np.ndarray
    person: np.ndarray
    background: np.ndarray
    opening: np.ndarray
    mouth: np.ndarray
    blink: np.ndarray
    phones: list[Phone]
    offset_frames: int

    @property
    def frames(self) -> int:
        return len(self.rotation)

    @property
    def size(self) -> int:
        return int(self.background.shape[0])

    def save(self, path: Path) -> None:
        """Writes an .npz file (no pickles)."""
        buffer = io.BytesIO()
        arrays = {
            name: getattr(self, name)
            for name in self.__dataclass_fields__
            if name not in ("rate", "phones")
        }
        np.savez_compressed(
            buffer,
            rate=np.array([self.rate.numerator, self.rate.denominator]),
            phone_symbol=np.array([p.symbol for p in self.phones], dtype="U8"),
            phone_start=np.array([p.start for p in self.phones]),
            phone_end=np.array([p.end for p in self.phones]),
            **arrays,
        )
        atomic_write_bytes(path, buffer.getvalue())

    @staticmethod
    def load(path: Path) -> "SpeakerTruth":
        """Reads what `save` wrote."""
        with np.load(path) as file:
            data = {name: file[name] for name in file.files}
        numerator, denominator = (int(n) for n in data.pop("rate"))
        columns = [data.pop(f"phone_{name}").tolist() for name in ("symbol", "start", "end")]
        phones = [Phone(*row) for row in zip(*columns, strict=True)]
        return SpeakerTruth(
            rate=Fraction(numerator, denominator),
            phones=phones,
            focal=float(data.pop("focal")),
            offset_frames=int(data.pop("offset_frames")),
            **data,
        )


def make_speaker(
    out: Path,
    *,
    text: str,
    seconds: float | None = None,
    size: int = 512,
    rate: Fraction = Fraction(25),
    face: str | Face = "alba",
    voice: str = "en-us",
    seed: int = 0,
    motion: float = 1.0,
    offset_frames: int = 0,
    progress: Progress | None = None,
) -> SpeakerTruth:
    """Writes out/clip.mp4 (picture and voice), out/speech.wav and out/truth.npz.

    The clip lasts as long as the text takes, or `seconds`: longer speech is cut there, shorter is
    followed by silence. `offset_frames` moves the sound against the picture (positive: the sound
    comes early). `motion` scales the motion of the head. The same call gives the same files.
    Raises `ExplainedError` for an unknown face or voice, or a size ffmpeg cannot encode.
    """
    person = face_by_name(face)
    if size < 64 or size % 2:
        raise ExplainedError(f"a clip cannot be {size} px wide", remedy="an even size from 64 on")
    samples, sound_rate, phones = synthesise(text, voice)
    spoken = len(samples) / sound_rate
    length = spoken + TAIL if seconds is None else seconds
    frames = max(1, round(length * rate))
    duration = float(frames / rate)
    phones = fit_phones(phones, duration)
    curves = mouth_curves(phones, frames, rate)
    moves = move(frames, rate, seed=seed, rest=REST_SHIFT, opening=curves[:, 0], amount=motion)
    renderer = Renderer(person, size)
    head = np.zeros((frames, size, size), np.uint8)
    body = np.zeros_like(head)
    opening = np.zeros(frames)
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out) as folder:
        silent = Path(folder) / "picture.mp4"
        with VideoWriter(silent, size, size, rate) as writer:
            for i, pose in enumerate(moves.poses):
                glance = (float(moves.gaze[i, 0]), float(moves.gaze[i, 1]))
                state = State(pose, MouthShape(*curves[i]), float(moves.blink[i]), glance)
                frame = renderer.render(state)
                writer.write(frame.image)
                head[i], body[i], opening[i] = frame.head, frame.person, frame.opening
                if progress is not None:
                    progress("rendering", (i + 1) / frames)
        sound = place_sound(samples, sound_rate, duration, float(offset_frames / rate))
        speech = out / "speech.wav"
        with atomic_path(speech) as temporary:
            soundfile.write(temporary, sound, sound_rate, subtype="PCM_16", format="WAV")
        mux(silent, speech, out / "clip.mp4", audio_start=0.0, seconds=duration)
    truth = SpeakerTruth(
        rate=rate,
        focal=renderer.camera.focal,
        centre=np.full(2, renderer.camera.centre),
        rotation=np.stack([p.rotation for p in moves.poses]),
        translation=np.stack([p.translation for p in moves.poses]),
        head=head,
        person=body,
        background=np.clip(np.rint(renderer.plate.colour), 0, 255).astype(np.uint8),
        opening=opening,
        mouth=curves,
        blink=moves.blink,
        phones=phones,
        offset_frames=offset_frames,
    )
    truth.save(out / "truth.npz")
    return truth


def fit_phones(phones: list[Phone], duration: float) -> list[Phone]:
    """Phones that tile 0..duration: cut at its end, or followed by silence."""
    kept = [Phone(p.symbol, p.start, min(p.end, duration)) for p in phones if p.start < duration]
    if kept[-1].end < duration:
        kept.append(Phone("", kept[-1].end, duration))
    return kept


def place_sound(samples: np.ndarray, rate: int, duration: float, early: float = 0.0) -> np.ndarray:
    """The sound of a clip: `duration` seconds of which sample t holds samples at t + early."""
    total = round(duration * rate)
    out = np.zeros(total, np.float32)
    first = round(early * rate)
    source = samples[max(0, first) : max(0, first + total)]
    begin = max(0, -first)
    out[begin : begin + len(source)] = source[: total - begin]
    return out
