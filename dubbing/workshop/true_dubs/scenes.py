"""The scenes of true dubs: how the head turns, who it is, and what the camera adds.

A film is `LEARNED` seconds to learn from, then `DUBBED` seconds that are dubbed.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dubbing.workshop.synthetic.anatomy.mesh import smoothstep

RATE = 25
LEARNED, DUBBED = 5.0, 2.6  # seconds
FRAMES = round((LEARNED + DUBBED) * RATE)
TURNS_AT, TURNED_AT = 1.6, 2.6  # seconds: between them a head turns to where it is held


@dataclass(frozen=True)
class Look:
    """Light, lens, motion and film stock, as they change a rendered frame.

    Attributes:
        flicker: the lamp's change, as a share of its light.
        band: the share of its light that a band of shadow takes, as it passes over the picture
            while it is dubbed; below 0 it is a beam, and adds.
        shake: px that a hand-held camera strays, at 320 px.
        fade: share of a light grey in the picture while it is dubbed, as in a faded print.
        zoom: how much larger the film is at its end.
        defocus: px, Gaussian, at 320 px.
        grain: grey levels, standard deviation.
        mono: black and white.
        blur: share of a frame's time that the shutter is open.
        shrink: side of the film as a share of the rendered one.
    """

    flicker: float = 0.0
    band: float = 0.0
    fade: float = 0.0
    shake: float = 0.0
    zoom: float = 1.0
    defocus: float = 0.0
    grain: float = 0.0
    mono: bool = False
    blur: float = 0.0
    shrink: float = 1.0


@dataclass(frozen=True)
class Scene:
    """One film.

    Attributes:
        face: of `FACES`.
        held: yaw to which the head turns while it is learned, and where it stays, degrees.
        passing: yaw to which it turns and back while it is dubbed; learned from the front alone.
        nod: pitch up and down while it is dubbed, degrees.
        motion: scales the small motion of the head.
        light: of the renderer.
        before: what is in front of the mouth while it is dubbed.
        size: side of the rendered frame, px. zoom: of the lens.
    """

    name: str
    face: str = "alba"
    held: float = 0.0
    passing: float = 0.0
    nod: float = 0.0
    motion: float = 1.0
    light: Literal["soft", "side"] = "soft"
    before: Literal["", "hand", "microphone", "passer-by"] = ""
    size: int = 320
    zoom: float = 1.0
    look: Look = Look()

    def turns(self) -> np.ndarray:
        """Pitch and yaw that are added to the head's small motion, (T, 2) degrees."""
        t = np.arange(FRAMES) / RATE
        share = np.clip((t - LEARNED) / DUBBED, 0, 1)  # of the dubbed seconds
        yaw = self.held * smoothstep(TURNS_AT, TURNED_AT, t)
        yaw = yaw + self.passing * np.sin(np.pi * share) ** 2
        return np.stack([self.nod * np.sin(2 * np.pi * share), yaw], 1)


SCENES = (
    Scene("front"),
    *(Scene(f"held-{yaw}", held=yaw) for yaw in (20, 40, 60, 80)),
    *(Scene(f"passing-{yaw}", passing=yaw) for yaw in (40, 60, 80)),
    Scene("nods", nod=25.0),
    Scene("beard", face="fedor"),
    Scene("moustache", face="igor"),
    Scene("glasses", face="gita"),
    Scene("loose-hair", face="hana"),
    Scene("hand", before="hand"),
    Scene("microphone", before="microphone"),
    Scene("passer-by", before="passer-by"),
    Scene("side-light", light="side"),
    Scene("flicker", look=Look(flicker=0.35)),
    Scene("shadow", look=Look(band=0.88)),
    Scene("beam", look=Look(band=-1.6)),
    Scene("faded", look=Look(fade=0.32)),
    Scene("hand-held", look=Look(shake=4.0)),
    Scene("zoom", look=Look(zoom=1.35)),
    Scene("defocus", look=Look(defocus=1.6)),
    Scene("motion-blur", motion=2.0, look=Look(blur=0.8)),
    Scene("grain", look=Look(grain=9.0)),
    Scene("mono", look=Look(mono=True)),
    Scene("small", look=Look(shrink=0.45)),
    Scene("large", size=1280, zoom=2.0),
)
