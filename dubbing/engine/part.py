"""A part of a stage's work, which several machines can do at once.

A part only fills the folder of the stage's work in progress; the stage itself then finds everything
there, and publishes it. A part has a claim of its own. Whoever claims the stage waits for the
claims of its parts, and a part that finds the stage claimed leaves the work to whoever holds it.
"""

from dataclasses import dataclass, field
from pathlib import Path

from dubbing.engine.stage import Stage

MARKS = "*.part.json"  # beside what the parts made, until the stage is whole: seconds they took


@dataclass(frozen=True)
class Part(Stage):
    """A part of ``whole``, made under its name, version, parameters and inputs: under its key."""

    whole: Stage = field(kw_only=True)
    of: str = field(kw_only=True)

    @property
    def mark(self) -> Path:
        """What lies there when the part is done: the seconds it took."""
        return self.partial() / MARKS.replace("*", self.of)

    def partial(self) -> Path:
        """Where the stage's work in progress lives."""
        return self.whole.partial()

    def changes(self) -> list[str]:
        """Why it has to be done; empty when it is, or when its stage is."""
        reasons = self.whole.changes()
        done = reasons and (self.mark.exists() or self.whole.record(self.partial()) is not None)
        return [] if done else reasons


def part_of(whole: Stage, name: str) -> Part:
    """The part of a stage that it calls so.

    Raises:
        KeyError: it has no such part.
    """
    return Part(
        whole.name,
        whole.folder.with_name(f"{whole.folder.name}.{name}"),
        whole.version,
        whole.parameters,
        whole.inputs,
        whole.parts[name],
        whole=whole,
        of=name,
    )
