"""Progress of a training run, and its loss curve."""

from __future__ import annotations

from dataclasses import dataclass, field, replace


@dataclass
class TrainingProgress:
    """Progress of a run, for a bar.

    Attributes:
        step, iterations: steps done, and in all.
        loss, psnr: of the last step, PSNR in dB over its rays.
        seconds_a_step: mean since the run started or resumed.
        samples_per_ray: of the last step.
    """

    step: int
    iterations: int
    loss: float
    psnr: float
    seconds_a_step: float
    samples_per_ray: float

    @property
    def seconds_left(self) -> float:
        """At the present pace."""
        return self.seconds_a_step * (self.iterations - self.step)

    def within(self, done: int, iterations: int) -> TrainingProgress:
        """The same step in a longer run, after `done` earlier steps."""
        return replace(self, step=done + self.step, iterations=iterations)

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
