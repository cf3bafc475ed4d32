"""Methods that are compared: presets by the names of the literature, and what is changed in them.

`dfrf-paper` is the paper's mouth at a size that can be learned on a processor: no crops of mouths,
no lip measures, no lips predicted from sound, no speaker adaptation. AudioNet and its attention
learn from pictures end to end, D_eta warps, attention fuses the references. Three things of `fast`
stay, as they change no equation: the grid and the packed samples (where (8) is summed, not what
is), the gate between the references' colours and the network's (a form of F_theta, which is given
both by (7)), and the measures of the upper face (so that eyes that blink do not teach the mouth).
`dfrf-nocrops` is `dfrf` without crops of mouths: its speech networks learn from lips, its lips are
predicted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dfrf import presets
from dfrf.config import FROM_BASE, STEPS, family
from dubbing.errors import ExplainedError
from dubbing.production.person import Person
from dubbing.shipped.base import shipped_base

PRESET_OF_METHOD = {
    "dfrf": "fast",
    "dfrf-alone": "fast-alone",
    "dfrf-nocrops": "fast-nocrops",
    "dfrf-paper": "fast-paper",
    "paper": "paper",
    "ad-nerf": "ad-nerf",
    "ad-nerf-nolips": "ad-nerf-nolips",
    "nerf": "nerf",
}


def preset_of(method: str) -> str:
    """The preset of a method.

    Raises:
        ExplainedError: there is no such method.
    """
    if method not in PRESET_OF_METHOD:
        raise ExplainedError(
            f"no method is called {method}", "--method", f"there is {', '.join(PRESET_OF_METHOD)}"
        )
    return PRESET_OF_METHOD[method]


@dataclass(frozen=True)
class Variant:
    """A method, and what is changed in it.

    Attributes:
        method: its name.
        references: so many in every frame, the same ones, in place of the preset's.
        warp: False leaves equations (3) and (4) out.
        base: checkpoint to start from, in place of the person's own and of the shipped one.
    """

    method: str = "dfrf"
    references: int | None = None
    warp: bool = True
    base: Path | None = None

    def __str__(self) -> str:
        """Name of its figures and folders: dfrf-2-nowarp."""
        count = "" if self.references is None else f"-{self.references}"
        return f"{self.method}{count}{'' if self.warp else '-nowarp'}"

    def check(self) -> None:
        """Refuses what the method does not have.

        Raises:
            ExplainedError: an unknown method, or one without references or warp to change.
        """
        preset = preset_of(self.method)
        try:
            without = presets.model_config(preset, 1, self.references)
            if not self.warp and without == presets.model_config(preset, 1, self.references, False):
                raise ValueError(f"preset {preset!r} has no warp")
        except ValueError as error:
            option = "--no-warp" if "warp" in str(error) else "--references"
            raise ExplainedError(f"{self.method}: {error}", option, "leave it out") from error

    def of(self, own: Person) -> Person:
        """A person as the method learns them: from their seconds alone, as the rest is held out.

        A base of the person's own serves their own preset, and all that the shipped base serves
        where that is one of them. References of their own are those of `dfrf`.
        """
        preset, settings = preset_of(self.method), own.settings
        served = FROM_BASE if settings.preset in FROM_BASE else (settings.preset,)
        keeps_base = own.own_base and self.base is None and preset in served
        count = self.references
        if count is None and self.method == "dfrf":
            count = settings.references
        keeps_steps = own.own_iterations or self.method == "dfrf"
        changed = replace(
            settings,
            preset=preset,
            references=count,
            warp=self.warp,
            turned=False,
            iterations=settings.iterations if keeps_steps else STEPS[family(preset)],
        )
        base = own.base if keeps_base else self.base or shipped_base(preset)
        return replace(own, settings=changed, base=base, own_base=keeps_base)


def variants(
    methods: Sequence[str],
    references: int | None = None,
    warp: bool = True,
    base: Path | None = None,
) -> tuple[Variant, ...]:
    """The same change of several methods.

    Raises:
        ExplainedError: see `Variant.check`.
    """
    found = tuple(Variant(method, references, warp, base) for method in methods)
    for variant in found:
        variant.check()
    return found
