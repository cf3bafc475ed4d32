"""Appearance of a synthetic person: proportions, colours, hair, clothes and room.

Colours are linear RGB reflectances in 0..1. Lengths are centimetres, proportions are factors
around 1. Eye corners are the same for everybody (outer corners 9 cm apart), because they fix the
unit of the head pose.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from dubbing.errors import ExplainedError

Colour = tuple[float, float, float]
HairStyle = Literal["short", "parted", "swept", "bob", "loose", "bald"]


@dataclass(frozen=True)
class Face:
    """One person. `seed` drives what no other field sets (freckles, locks of hair, the room)."""

    name: str = "alba"
    skin: Colour = (0.58, 0.33, 0.235)
    lips: Colour = (0.47, 0.16, 0.15)
    eyes: Colour = (0.10, 0.16, 0.13)
    hair: Colour = (0.060, 0.030, 0.016)
    hair_style: HairStyle = "parted"
    hair_volume: float = 1.0
    brow_thickness: float = 1.0
    stubble: float = 0.0
    beard: float = 0.0  # length in cm; 1.0 is a short full beard
    moustache: float = 0.0  # length in cm
    glasses: bool = False
    freckles: float = 0.2
    jaw_width: float = 1.0
    chin_length: float = 1.0
    nose_length: float = 1.0
    nose_width: float = 1.0
    lip_fullness: float = 1.0
    mouth_width: float = 1.0
    cheekbones: float = 1.0
    eye_opening: float = 1.0
    shirt: Colour = (0.045, 0.105, 0.19)
    shirt_style: Literal["crew", "collar"] = "crew"
    room: Colour = (0.23, 0.25, 0.24)
    seed: int = 0
    lamp: Colour = field(default=(1.0, 0.80, 0.56))


FACES: dict[str, Face] = {
    face.name: face
    for face in (
        Face(),
        Face(
            name="bruno",
            skin=(0.52, 0.30, 0.205),
            lips=(0.41, 0.145, 0.13),
            eyes=(0.16, 0.085, 0.035),
            hair=(0.020, 0.014, 0.011),
            hair_style="short",
            brow_thickness=1.35,
            stubble=0.75,
            freckles=0.05,
            jaw_width=1.08,
            chin_length=1.06,
            nose_length=1.08,
            nose_width=1.1,
            lip_fullness=0.98,
            cheekbones=0.9,
            eye_opening=0.92,
            shirt=(0.30, 0.055, 0.045),
            shirt_style="collar",
            room=(0.20, 0.21, 0.25),
            seed=1,
        ),
        Face(
            name="chidi",
            skin=(0.165, 0.078, 0.043),
            lips=(0.185, 0.065, 0.055),
            eyes=(0.045, 0.022, 0.012),
            hair=(0.011, 0.009, 0.008),
            hair_style="short",
            hair_volume=0.6,
            brow_thickness=1.1,
            stubble=0.25,
            freckles=0.0,
            jaw_width=1.04,
            nose_width=1.25,
            lip_fullness=1.3,
            cheekbones=1.15,
            shirt=(0.42, 0.36, 0.25),
            room=(0.27, 0.23, 0.19),
            seed=2,
        ),
        Face(
            name="dora",
            skin=(0.66, 0.405, 0.305),
            lips=(0.52, 0.20, 0.19),
            eyes=(0.075, 0.16, 0.25),
            hair=(0.30, 0.165, 0.065),
            hair_style="bob",
            brow_thickness=0.8,
            freckles=0.7,
            jaw_width=0.95,
            chin_length=0.96,
            nose_length=0.93,
            nose_width=0.94,
            lip_fullness=1.1,
            eye_opening=1.08,
            shirt=(0.10, 0.24, 0.17),
            room=(0.26, 0.27, 0.29),
            seed=3,
        ),
        Face(
            name="emil",
            skin=(0.60, 0.36, 0.27),
            lips=(0.46, 0.165, 0.15),
            eyes=(0.09, 0.13, 0.15),
            hair=(0.34, 0.31, 0.28),
            hair_style="swept",
            brow_thickness=1.2,
            stubble=0.35,
            jaw_width=1.03,
            chin_length=1.03,
            nose_length=1.12,
            lip_fullness=0.95,
            shirt=(0.40, 0.41, 0.42),
            shirt_style="collar",
            room=(0.19, 0.23, 0.22),
            seed=4,
        ),
        Face(
            name="fedor",
            skin=(0.56, 0.32, 0.225),
            lips=(0.44, 0.16, 0.145),
            eyes=(0.07, 0.11, 0.14),
            hair=(0.085, 0.042, 0.020),
            hair_style="short",
            brow_thickness=1.3,
            beard=1.2,
            moustache=0.9,
            jaw_width=1.05,
            nose_length=1.05,
            nose_width=1.08,
            shirt=(0.16, 0.17, 0.15),
            room=(0.25, 0.23, 0.20),
            seed=5,
        ),
        Face(
            name="gita",
            skin=(0.36, 0.19, 0.115),
            lips=(0.34, 0.115, 0.11),
            eyes=(0.06, 0.032, 0.018),
            hair=(0.016, 0.012, 0.010),
            hair_style="swept",
            glasses=True,
            freckles=0.0,
            jaw_width=0.96,
            chin_length=0.98,
            nose_length=0.98,
            lip_fullness=1.15,
            shirt=(0.33, 0.10, 0.17),
            room=(0.24, 0.25, 0.22),
            seed=6,
        ),
        Face(
            name="hana",
            skin=(0.60, 0.37, 0.26),
            lips=(0.50, 0.17, 0.165),
            eyes=(0.05, 0.028, 0.016),
            hair=(0.024, 0.016, 0.012),
            hair_style="loose",
            brow_thickness=0.9,
            freckles=0.1,
            jaw_width=0.94,
            chin_length=0.97,
            nose_length=0.94,
            nose_width=0.98,
            lip_fullness=1.08,
            eye_opening=1.02,
            shirt=(0.30, 0.31, 0.33),
            room=(0.22, 0.24, 0.27),
            seed=7,
        ),
        Face(
            name="igor",
            skin=(0.47, 0.265, 0.18),
            lips=(0.39, 0.14, 0.125),
            eyes=(0.10, 0.055, 0.028),
            hair=(0.030, 0.020, 0.015),
            hair_style="swept",
            brow_thickness=1.3,
            stubble=0.35,
            moustache=1.1,
            freckles=0.05,
            jaw_width=1.03,
            chin_length=1.04,
            nose_length=1.06,
            nose_width=1.05,
            cheekbones=0.95,
            eye_opening=0.95,
            shirt=(0.09, 0.12, 0.10),
            shirt_style="collar",
            room=(0.23, 0.22, 0.25),
            seed=8,
        ),
    )
}

BLENDED = ("alba", "bruno", "chidi", "dora", "emil")  # the faces that random ones are drawn from


def random_face(seed: int) -> Face:
    """A person drawn from the ranges of `BLENDED`: for training material of many identities."""
    rng = np.random.default_rng(seed)
    first, second = rng.choice(BLENDED, size=2, replace=False)
    a, b = FACES[first], FACES[second]
    mix = float(rng.uniform(0.0, 1.0))

    def blend(x: Colour, y: Colour) -> Colour:
        low, mid, high = (float(p ** (1 - mix) * q**mix) for p, q in zip(x, y, strict=True))
        return low, mid, high

    def factor(spread: float) -> float:
        return float(np.clip(rng.normal(1.0, spread), 1 - 2 * spread, 1 + 2 * spread))

    red, green, blue = (float(c) for c in rng.uniform(0.03, 0.5, 3))
    return replace(
        a,
        name=f"person{seed:03d}",
        skin=blend(a.skin, b.skin),
        lips=blend(a.lips, b.lips),
        eyes=b.eyes,
        hair=blend(a.hair, b.hair),
        hair_volume=factor(0.15),
        brow_thickness=factor(0.15),
        freckles=float(rng.uniform(0.0, 0.7)),
        jaw_width=factor(0.05),
        chin_length=factor(0.03),
        nose_length=factor(0.05),
        nose_width=factor(0.1),
        lip_fullness=0.1 + factor(0.1),
        mouth_width=factor(0.05),
        cheekbones=factor(0.1),
        eye_opening=factor(0.05),
        shirt=(red, green, blue),
        room=blend(a.room, b.room),
        seed=1000 + seed,
    )


def face_by_name(face: "str | Face") -> Face:
    """The face itself, one of `FACES` by name, or `random:N`. Raises `ExplainedError`."""
    if isinstance(face, Face):
        return face
    if face.startswith("random:") and face[7:].isdigit():
        return random_face(int(face[7:]))
    if face not in FACES:
        raise ExplainedError(
            f"no synthetic face is called {face!r}",
            remedy=f"choose one of {', '.join(sorted(FACES))} or random:N",
        )
    return FACES[face]
