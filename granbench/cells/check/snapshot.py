"""The torch modules of a cell, and a snapshot of every value that could hold a memory."""

import random
import types
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch

from granbench.cells.contract import MaterialCell

MOST_LEVELS = 6
MOST_ENTRIES = 100
"""How far attributes of attributes, and the entries of lists, are followed."""

SIMPLE_TYPES = (bool, int, float, complex, str, type(None))
LIBRARIES = ("torch", "numpy", "builtins", "collections", "typing", "granbench")
"""Packages whose objects are not searched, except modules and cells."""


def modules_of(cell: MaterialCell) -> list[torch.nn.Module]:
    """The torch modules of a cell, each once, with those inside other modules."""
    found: dict[int, torch.nn.Module] = {}
    for _, part in _parts(cell):
        if isinstance(part, torch.nn.Module):
            found |= {id(module): module for module in part.modules()}
    return list(found.values())


@contextmanager
def evaluation_mode(cell: MaterialCell) -> Iterator[list[str]]:
    """Put all modules of a cell into evaluation mode, and back at the end.

    Returns
    -------
    Class names of the modules that were in training mode and behave differently in it, such as
    ``Dropout``
    """
    modes = [(module, module.training) for module in modules_of(cell)]
    kinds = [
        type(module).__name__ for module, training in modes if training and _depends_on_mode(module)
    ]
    try:
        for module, _ in modes:
            module.training = False
        yield list(dict.fromkeys(kinds))
    finally:
        for module, training in modes:
            module.training = training


def _depends_on_mode(module: torch.nn.Module) -> bool:
    """Whether a module behaves differently in training, as dropout and batch normalisation do."""
    share = getattr(module, "p", getattr(module, "dropout", None))
    if isinstance(share, int | float) and share == 0:
        return False
    code = getattr(type(module).forward, "__code__", None)
    return code is not None and "training" in code.co_names


def snapshot(cell: MaterialCell) -> dict[str, Any]:
    """Values of everything in a cell that could remember something, by dotted name.

    It includes the states of torch's, NumPy's and Python's random number generators, under names
    that begin with ``random numbers``.
    """
    values: dict[str, Any] = {}
    for name, part in _parts(cell):
        if isinstance(part, torch.Tensor):
            values[name] = part.detach().clone()
        elif isinstance(part, np.ndarray):
            values[name] = part.copy()
        elif isinstance(part, np.random.Generator):
            values[f"random numbers of {name}"] = str(part.bit_generator.state)
        elif isinstance(part, torch.Generator):
            values[f"random numbers of {name}"] = part.get_state()
        elif isinstance(part, SIMPLE_TYPES):
            values[name] = part
        elif isinstance(part, Mapping | Sequence):
            values[name] = len(part)
    values["random numbers of torch"] = torch.get_rng_state()
    _, key, place, *_ = np.random.get_state()  # noqa: NPY002, what a user's code may draw from
    values["random numbers of NumPy"] = np.append(key, place)
    values["random numbers of Python"] = random.getstate()
    return values


def changed(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """Names of what differs between two snapshots."""
    names = [*before, *(name for name in after if name not in before)]
    return [
        name
        for name in names
        if name not in before or name not in after or not _equal(before[name], after[name])
    ]


def _equal(one: Any, other: Any) -> bool:
    if type(one) is not type(other):
        return False
    if isinstance(one, torch.Tensor | np.ndarray):
        one, other = np.asarray(one), np.asarray(other)
        return one.shape == other.shape and one.tobytes() == other.tobytes()
    return bool(one == other) or one != one


def _parts(cell: MaterialCell) -> Iterator[tuple[str, Any]]:
    """Everything in a cell under its dotted name, each object once."""
    seen: set[int] = set()
    waiting: list[tuple[str, Any, int]] = [("", cell, 0)]
    while waiting:
        name, part, depth = waiting.pop(0)
        if depth > MOST_LEVELS or (id(part) in seen and not isinstance(part, SIMPLE_TYPES)):
            continue
        seen.add(id(part))
        if name or isinstance(part, torch.nn.Module):
            yield name, part
        waiting += [
            (f"{name}.{key}".lstrip("."), value, depth + 1) for key, value in _held_by(part)
        ]


def _held_by(part: Any) -> list[tuple[str, Any]]:
    """The parts that an object holds directly, by name."""
    if isinstance(part, torch.Tensor | np.ndarray | type):
        return []
    if isinstance(part, Mapping):
        return [(str(key), value) for key, value in list(part.items())[:MOST_ENTRIES]]
    if isinstance(part, list | tuple | set | frozenset):
        return [(str(place), value) for place, value in enumerate(list(part)[:MOST_ENTRIES])]
    if isinstance(part, types.MethodType):
        return [("self", part.__self__), *_held_by(part.__func__)]
    if isinstance(part, types.FunctionType):
        return _held_by_function(part)
    held = dict(getattr(part, "__dict__", {}))
    if isinstance(part, torch.nn.Module):
        held = {key: value for key, value in held.items() if not key.startswith("_")}
        held |= part._parameters | part._buffers | part._modules
        own = type(part).forward
    elif isinstance(part, MaterialCell):
        own = type(part).step
    elif type(part).__module__.split(".")[0] in LIBRARIES:
        return []
    else:
        return list(held.items())
    within = list(held.items())
    if type(part).__module__.split(".")[0] not in LIBRARIES:
        own_class = vars(type(part)).items()
        within += [item for item in own_class if item[0] not in held and _may_remember(*item)]
        within += _held_by_function(own) if isinstance(own, types.FunctionType) else []
    return within


def _may_remember(key: str, value: Any) -> bool:
    """Whether an attribute of a class could remember something between calls."""
    return not key.startswith("__") and isinstance(
        value, int | float | list | dict | set | torch.Tensor | np.ndarray | np.random.Generator
    )


def _held_by_function(function: types.FunctionType) -> list[tuple[str, Any]]:
    """What a function can remember in: globals of its module, closures and default values."""
    names = function.__code__.co_names
    found = [(name, function.__globals__[name]) for name in names if name in function.__globals__]
    held = [item for item in found if not isinstance(item[1], types.ModuleType | type)]
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            held.append((name, cell.cell_contents))
        except ValueError:  # not set yet
            continue
    held += [(f"default {place}", each) for place, each in enumerate(function.__defaults__ or ())]
    return [item for item in held if not isinstance(item[1], types.BuiltinFunctionType)]
