"""Cells from a user's own factory, a function that is named as ``package.module:function``."""

import importlib
import inspect
import random
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch

from granbench.cells.check.attributes import require_attributes
from granbench.cells.contract import MaterialCell
from granbench.cells.user_code import user_code
from granbench.errors import ModelError, alternatives

WRAPPING = "returns granbench.cells.ModuleCell(module, name=...)"


def imported_factory(name: str) -> Callable[..., Any]:
    """The function that ``package.module:function`` names.

    Raises
    ------
    ModelError
        If the module cannot be imported, or has no such function.
    """
    module_name, _, attribute = name.partition(":")
    if "" not in sys.path:
        sys.path.insert(0, "")  # a user's own module lies where the command is run
    with user_code(f"module {module_name!r} cannot be imported"):
        try:
            module = importlib.import_module(module_name)
        except ModuleNotFoundError as error:
            if not _is_missing_itself(module_name, error.name):
                raise  # the module is there, but something that it imports is not
            raise ModelError(
                f"there is no module {error.name!r} for model {name!r}; "
                f"{_module_remedy(module_name)}"
            ) from error
    factory = getattr(module, attribute, None)
    if isinstance(factory, MaterialCell | torch.nn.Module):
        raise ModelError(
            f"{name} is {_kind_with_article(factory)} itself; give a function without arguments "
            f"that {'returns it' if isinstance(factory, MaterialCell) else WRAPPING}"
        )
    if not callable(factory):
        functions = [name for name, value in vars(module).items() if inspect.isfunction(value)]
        raise ModelError(
            f"module {module_name!r} has no function {attribute!r}: "
            f"{alternatives(attribute, functions)}; give package.module:function"
        )
    return factory


def cell_from_factory(factory: Callable[..., Any], name: str, **offered: Any) -> MaterialCell:
    """The cell that a factory returns.

    Parameters
    ----------
    factory : the function
    name : of the function, for errors
    offered : arguments by name, of which it is given those that it takes; `seed` among them, from
        which whatever it draws at random follows

    Raises
    ------
    ModelError
        If the factory needs another argument, fails, or returns no cell.
    """
    with user_code(f"{name} failed"):
        parameters = _parameters(factory)
        lacking = [
            parameter_name
            for parameter_name, parameter in parameters.items()
            if parameter.default is parameter.empty
            and parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
            and (parameter_name not in offered or parameter.kind is parameter.POSITIONAL_ONLY)
        ]
        if lacking:
            raise ModelError(
                f"{name} needs the argument {lacking[0]!r}, but is called with "
                f"{', '.join(offered)} only, by keyword; give {lacking[0]!r} a default value"
            )
        taken = {name: value for name, value in offered.items() if name in parameters}
        with _random_numbers_from(int(offered["seed"])):
            cell = factory(**taken)
    if not isinstance(cell, MaterialCell):
        raise ModelError(f"{name} returned {_kind_with_article(cell)}; {_result_remedy(cell)}")
    with user_code(f"{name} failed"):
        require_attributes(cell)
    return cell


def _is_missing_itself(wanted: str, missing: str | None) -> bool:
    """Whether what is missing is the module itself, or a package that it should lie in."""
    return missing is None or wanted == missing or wanted.startswith(f"{missing}.")


def _module_remedy(module_name: str) -> str:
    path = Path(module_name)
    if path.suffix == ".py" or len(path.parts) > 1:
        return f"give a module as Python imports it: {'.'.join(path.with_suffix('').parts)}"
    return "run Python in a folder from which it can be imported"


def _parameters(factory: Callable[..., Any]) -> Mapping[str, inspect.Parameter]:
    try:
        return inspect.signature(factory).parameters
    except ValueError:  # of some functions that are not written in Python
        return {}


@contextmanager
def _random_numbers_from(seed: int) -> Iterator[None]:
    """Random numbers of torch, NumPy and Python that follow from the seed, for new weights."""
    before = random.getstate(), np.random.get_state()  # noqa: NPY002, a user's code may draw so
    with torch.random.fork_rng(devices=[]):
        try:
            torch.manual_seed(seed % 2**63)
            np.random.seed(seed % 2**32)  # noqa: NPY002
            random.seed(seed)
            yield
        finally:
            random.setstate(before[0])
            np.random.set_state(before[1])  # noqa: NPY002


def _kind_with_article(found: object) -> str:
    if found is None:
        return "nothing"
    if isinstance(found, type):
        return f"the class {found.__name__}"
    return f"an object of type {type(found).__name__}"


def _result_remedy(found: object) -> str:
    """What to do with a result that is not a cell."""
    if found is None:
        return "end it with `return` and the cell"
    if isinstance(found, type):
        return f"return an instance, as {found.__name__}()"
    return (
        "return a MaterialCell; wrap a torch module in granbench.cells.ModuleCell(module, name=...)"
    )
