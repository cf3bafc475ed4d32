"""Clips of the synthetic speaker, whose sound is exactly in time with the mouth.

They are the only clips whose offset is known and not found: they set the zero of the network.
The speaker's mouth runs 30 ms ahead of the phones, as articulators do
(`dubbing.workshop.synthetic.visemes`).
"""

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from dubbing.workshop.synthetic.anatomy.face import random_face
from dubbing.workshop.synthetic.speaker import TEXTS, make_speaker

SECONDS = 8.0
SIZE = 128


class Part(NamedTuple):
    """A speaker: the seed of the face and the motion, an espeak-ng voice, a text."""

    seed: int
    voice: str
    text: str


TRAINING_SPEAKERS = (
    Part(0, "en-us", TEXTS[0]),
    Part(1, "en-us+f2", TEXTS[1]),
    Part(
        2,
        "de+m4",
        "Wir haben am Montag fünf alte Bücher gefunden, und keiner wusste, wem sie gehören. "
        "Bitte frag morgen deine Mutter, ob sie etwas davon weiß.",
    ),
    Part(3, "en-us+m3", TEXTS[2]),
    Part(
        4,
        "it+f3",
        "Domani mattina vado al mercato e compro pane, uva, formaggio e un po' di pesce. "
        "Poi torno a casa, apro la finestra e aspetto che smetta di piovere.",
    ),
    Part(
        5,
        "en-us+f4",
        "Over the hills a small village woke up early. Four men opened the old mill, "
        "and before noon the whole place smelled of apples, smoke and fresh wood.",
    ),
)
# Other faces, voices and texts, never learned from: what the tables are measured on.
UNSEEN = (
    Part(
        101,
        "en-us+m7",
        "Nobody remembers who built the tower, but everybody has climbed it at least once. "
        "From above you can see both rivers, the harbour, and people waving at the ferry.",
    ),
    Part(
        102,
        "de+f2",
        "Guten Abend! Heute Nachmittag hat es überall geregnet, aber am Abend wurde es schön. "
        "Wo bleibt eigentlich der Bus nach Bonn? Er wollte um halb fünf hier sein.",
    ),
    Part(
        103,
        "es+f3",
        "Buenas tardes. Mi hermano vive cerca del puerto y baja todos los días a comprar fruta. "
        "Ayer me trajo uvas, melón y un ramo de flores para mi abuela.",
    ),
)


def speaker_clips(
    folder: Path, parts: Sequence[Part], log: Callable[[str], None] | None = None
) -> list[Path]:
    """The clips of `parts` in `folder`; those that exist already are kept."""
    clips = []
    for part in parts:
        clip = folder / f"speaker{part.seed:03d}.mp4"
        if not clip.exists():
            with tempfile.TemporaryDirectory(dir=folder) as making:
                make_speaker(
                    Path(making),
                    text=part.text,
                    seconds=SECONDS,
                    size=SIZE,
                    face=random_face(part.seed),
                    voice=part.voice,
                    seed=part.seed,
                )
                (Path(making) / "clip.mp4").replace(clip)
            if log is not None:
                log(f"made {clip.name}")
        clips.append(clip)
    return clips
