"""How far a run is, and what its losses were."""

from __future__ import annotations

from dataclasses import dataclass, field, replace


@dataclass
class Progress:
    """How far a run is, for a bar.

    Attributes:
        step, iterations: steps done, and in all.
        loss, psnr: of the last step, PSNR in dB over its rays.
        seconds_left: at the present pace.
        samples_per_ray: of the last step.
    """

    step: int
    iterations: int
    loss: float
    psnr: float
    seconds_left: float
    samples_per_ray: float

    def within(self, done: int, iterations: int) -> Progress:
        """The same step as one of a longer run, of which `done` steps came before this one's."""
        step = done + self.step
        share = (iterations - step) / max(self.iterations - self.step, 1)
        left = self.seconds_left * share
        return replace(self, step=step, iterations=iterations, seconds_left=left)

    def __str__(self) -> str:
        left = f"{self.seconds_left:.0f} s left"
        samples = f"{self.samples_per_ray:.1f} samples a ray"
        return f"step {self.step}, loss {self.loss:.4g}, {self.psnr:.1f} dB, {samples}, {left}"


@dataclass
class Curve:
    """The loss curve: one row a step."""

    rows: list[tuple[int, float, float, float]] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        """Spent so far."""
        return self.rows[-1][3] if self.rows else 0.0

    def add(self, step: int, loss: float, psnr: float, seconds: float) -> None:
        """Notes a step: its loss, its PSNR in dB and the seconds since the run began."""
        self.rows.append((step, loss, psnr, seconds))
