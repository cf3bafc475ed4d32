"""Merges steps that do the same to several tensors: a third of the steps, and of the time.

The network of landmarks has three branches, later five, of the same layers with other weights. Side
by side in the channels they are one branch of grouped convolutions.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field

import numpy as np

from dubbing.workshop.faces.conversion import Step

# Steps that work with channels side by side.
MERGED = ("box", "crop", "convolve", "prelu", "add", "add_narrow", "scale", "max_pool")
FIRST = "box"  # begins the branches, at one tensor
LISTS = ("ends", "points")  # settings that hold one entry a branch
FIRST_NEW = 10_000  # number of the first tensor that the source does not have

Weights = dict[str, np.ndarray]


def without_repetitions(steps: list[Step], weights: Weights) -> list[Step]:
    """Steps without those that compute what another one computed."""
    known: dict[str, int] = {}
    same: dict[int, int] = {}
    kept = []
    for source in steps:
        step = source | {"in": [same.get(tensor, tensor) for tensor in source["in"]]}
        values = [weights[name].tobytes().hex() for name in step.get("weights", ())]
        key = json.dumps([step | {"out": 0, "weights": values}])
        if known.setdefault(key, step["out"]) == step["out"]:
            kept.append(step)
        else:
            same[step["out"]] = known[key]
            for name in step.get("weights", ()):
                del weights[name]
    return kept


def merged(steps: list[Step], outputs: list[int], weights: Weights) -> list[Step]:
    """Steps in which branches lie side by side; `weights` are changed with them."""
    return _Merger(weights).merge(steps, outputs)


@dataclass
class _Merger:
    weights: Weights
    steps: list[Step] = field(default_factory=list)
    # Of a tensor: the tensor that it lies in, its place there, and how many lie there.
    places: dict[int, tuple[int, int]] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    known: dict[str, int] = field(default_factory=dict)

    def merge(self, steps: list[Step], outputs: list[int]) -> list[Step]:
        left = list(steps)
        while left:
            step = left.pop(0)
            alike = [other for other in left if self._key(other) == self._key(step)]
            slotted = any(tensor in self.places for tensor in step["in"])
            if alike and step["op"] in MERGED and (slotted or step["op"] == FIRST):
                left = [other for other in left if other not in alike]
                self._add([step, *alike])
            else:
                self.steps.append(step | {"in": [self._alone(k) for k in step["in"]]})
        for tensor in outputs:
            assert tensor not in self.places
        return self.steps

    def _key(self, step: Step) -> str:
        """Equal for steps that can be one."""
        settings = {k: v for k, v in step.items() if k not in ("in", "out", "weights", *LISTS)}
        shapes = [self.weights[name].shape for name in step.get("weights", ())]
        inputs = [self.places.get(tensor, (tensor, 0))[0] for tensor in step["in"]]
        return json.dumps([settings, shapes, inputs])

    def _new(self, step: Step) -> int:
        """Number of the result of a new step, which is not added where it is known."""
        number = FIRST_NEW + len(self.known)
        key = json.dumps(step)
        if key not in self.known:
            self.known[key] = number
            self.steps.append({**step, "out": number})
        return self.known[key]

    def _alone(self, tensor: int) -> int:
        if tensor not in self.places:
            return tensor
        whole, place = self.places[tensor]
        step = {"op": "take", "in": [whole], "parts": self.counts[whole], "places": [place]}
        return self._new(step)

    def _side_by_side(self, tensors: list[int]) -> int:
        """The tensor in which these lie, in their order."""
        if tensors[0] not in self.places:
            return tensors[0]  # one that all branches share
        whole = self.places[tensors[0]][0]
        places = [self.places[tensor][1] for tensor in tensors]
        parts = self.counts[whole]
        if places == list(range(parts)):
            return whole
        return self._new({"op": "take", "in": [whole], "parts": parts, "places": places})

    def _add(self, alike: list[Step]) -> None:
        step = dict(alike[0])
        inputs = zip(*(s["in"] for s in alike), strict=True)
        step["in"] = [self._side_by_side(list(tensors)) for tensors in inputs]
        names = list(zip(*(s.get("weights", ()) for s in alike), strict=True))
        axis = 1 if step["op"] == "scale" else 0
        for first, *others in names:
            parts = [self.weights[first], *(self.weights.pop(name) for name in others)]
            self.weights[first] = np.concatenate(parts, axis)
        if "groups" in step:
            step["groups"] *= len(alike)
        if step["op"] in ("crop", "add_narrow"):
            step["parts"] = len(alike)
        for name in LISTS:
            if name in step:
                step[name] = [entry for s in alike for entry in s[name]]
        self.steps.append(step)
        self.counts[step["out"]] = len(alike)
        for place, other in enumerate(alike):
            self.places[other["out"]] = (step["out"], place)
