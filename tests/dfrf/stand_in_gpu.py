"""A stand-in for `cuda`: tensors that compute on the CPU, but have a device and keep to it.

A tensor is moved, made or asked for its device as on a GPU; an operation on tensors of two devices
raises, as it would there. What Python never sees stays on the CPU and unchecked: the inside of a
function of torch, and of a backward pass. Dtypes, kernels and generators of a GPU are not tried.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Self

import torch
from torch import Tensor
from torch.nn import Parameter
from torch.overrides import TorchFunctionMode

CPU, GPU = torch.device("cpu"), torch.device("cuda", 0)
# Between two devices on purpose, or about neither.
FREE = {
    Tensor.copy_,
    Tensor.to,
    Tensor.type_as,
    Tensor.data.__set__,  # type: ignore[attr-defined]
    torch._has_compatible_shallow_copy_type,
}
JOINED = {torch.cat, torch.stack}
AWAY = {"numpy", "__array__"}


class MixedDevicesError(RuntimeError):
    """An operation was given tensors of two devices."""


def place(tensor: Tensor) -> torch.device:
    """The device that a tensor says it is on."""
    return GPU if "on_gpu" in tensor.__dict__ else CPU


def put(result: object, device: torch.device) -> None:
    """Says of tensors, and of those in lists, that they are on a device."""
    for tensor in tensors([result]):
        if device == GPU:
            tensor.__dict__["on_gpu"] = True
        else:
            tensor.__dict__.pop("on_gpu", None)


def tensors(values: Iterable[object]) -> Iterator[Tensor]:
    """The tensors among values and in lists of them."""
    for value in values:
        if isinstance(value, Tensor):
            yield value
        elif isinstance(value, list | tuple):
            yield from tensors(value)


def target(func: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
    """The device that a call names, if it does."""
    if func is Tensor.cpu:
        return CPU
    if func is Tensor.type_as:
        return place(args[1])
    if func is Tensor.to:
        other = next(tensors(args[1:]), kwargs.get("other"))
        if isinstance(other, Tensor):
            return place(other)
        named = [a for a in args[1:] if isinstance(a, torch.device | str)]
        return named[0] if named else kwargs.get("device")
    return kwargs.get("device")


class StandInGpu(TorchFunctionMode):
    """Inside of it `cuda` is a device; calls are counted in `calls` by where their result is."""

    def __init__(self) -> None:
        super().__init__()
        self.calls = {CPU: 0, GPU: 0}
        self.copy_parameter = Parameter.__deepcopy__

    def __enter__(self) -> Self:
        def copied(parameter: Parameter, memo: dict[int, Any]) -> Parameter:
            made: Parameter = self.copy_parameter(parameter, memo)
            put(made, place(parameter))
            return made

        # The one way to a new tensor that a mode does not see.
        Parameter.__deepcopy__ = copied  # type: ignore[method-assign, assignment]
        super().__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        super().__exit__(*error)
        Parameter.__deepcopy__ = self.copy_parameter  # type: ignore[method-assign]

    def __torch_function__(
        self,
        func: Callable[..., Any],
        types: object,
        args: tuple[Any, ...] = (),
        kwargs: dict[str, Any] | None = None,
    ) -> Any:
        kwargs = dict(kwargs or {})
        if func == Tensor.device.__get__:  # type: ignore[attr-defined]
            return place(args[0])
        if func == Tensor.is_cuda.__get__:  # type: ignore[attr-defined]
            return place(args[0]) == GPU
        given = list(tensors([*args, *kwargs.values()]))
        device = self.common(func, args, given)
        if getattr(func, "__name__", "") in AWAY and device == GPU:
            raise MixedDevicesError("numpy cannot read a tensor of the GPU")
        wanted = target(func, args, kwargs)
        if wanted is not None:
            device = GPU if torch.device(wanted).type == "cuda" else CPU
            if device == GPU and isinstance(kwargs.get("generator"), torch.Generator):
                raise MixedDevicesError(f"{func.__name__}: the generator is the CPU's")
            args = tuple(CPU if isinstance(a, torch.device | str) else a for a in args)
            kwargs = {name: CPU if name == "device" else v for name, v in kwargs.items()}
        result = func(*args, **kwargs)
        if func is Tensor.__iter__:
            parts = list(result)
            put(parts, device)
            return iter(parts)
        if wanted is not None and any(result is g and place(g) != device for g in given):
            result = result.clone()
        if func == Tensor.data.__set__:  # type: ignore[attr-defined]
            put(args[0], place(args[1]))
        elif not any(result is g for g in given):
            put(result, device)
        self.calls[device] += 1
        return result

    def common(
        self, func: Callable[..., Any], args: tuple[Any, ...], given: list[Tensor]
    ) -> torch.device:
        """Where an operation is computed.

        Raises:
            MixedDevicesError: its tensors are on two devices. Scalars may be; so may the indices of
                what is on the GPU.
        """
        if func in FREE or (func is Tensor.__getitem__ and place(args[0]) == GPU):
            return place(given[0])
        if func is Tensor.__setitem__ and place(args[0]) == GPU:
            given = [g for g in given if g is args[0] or any(g is v for v in args[2:])]
        tied = [g for g in given if g.dim() or func in JOINED or place(g) == GPU]
        places = {place(g) for g in tied}
        if len(places) > 1:
            shapes = ", ".join(f"{tuple(g.shape)} on {place(g)}" for g in tied)
            raise MixedDevicesError(f"{getattr(func, '__name__', func)}: {shapes}")
        return places.pop() if places else CPU
