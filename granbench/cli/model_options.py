"""Options of several commands that name a model, and the state that it starts from."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granbench.errors import ConfigurationError, ModelError

if TYPE_CHECKING:
    from granbench.cells.find import FoundModel
    from granbench.element_test.start import Start

START_OPTIONS = {"initial_void_ratio": "--e0", "overconsolidation_ratio": "--ocr"}
"""Options that give a scalar at the start; all other scalars are given with `--start`."""


def one_model(
    name: str,
    parameter_set: str | None = None,
    parameter_file: Path | None = None,
    task: str | None = None,
    order: str | None = None,
) -> "FoundModel":
    """The model that a command names, for one seed; see `granbench.cells.find.find_cells`.

    Parameters
    ----------
    name : name of the model
    parameter_set, parameter_file : from --set and --params
    task : from --task; None for the default of `find_cells`
    order : component order of a classical model
    """
    from granbench.cells.find import DEFAULT_RECORDS, find_cells

    options = {"--set": parameter_set, "--params": parameter_file}
    given = [option for option, value in options.items() if value is not None]
    if len(given) > 1:
        raise ConfigurationError("--set and --params both give parameters; leave one out")
    with _named_options(given), _training_command():
        return find_cells(
            name,
            task or DEFAULT_RECORDS,
            order=order,
            parameter_set=parameter_set,
            parameter_file=parameter_file,
            seeds=(0,),
        )


def evaluated_model(
    name: str, records: Any, folders: Sequence[Path], seeds: Sequence[int] | None
) -> "FoundModel":
    """The model that is evaluated; see `granbench.cells.find.find_cells`.

    Parameters
    ----------
    name : name of the model
    records : whole dataset of the task
    folders, seeds : from --model-dir and --seeds
    """
    from granbench.cells.find import find_cells

    given = ["--model-dir"] if folders else []
    given += [] if seeds is None else ["--seeds"]
    with _named_options(given), _training_command():
        return find_cells(name, records, folders=folders, seeds=seeds)


@contextmanager
def named_start_options(start: "Start") -> Iterator[None]:
    """Name the options that set the start in every error about it."""
    from granbench.cells.contract import MissingScalarError
    from granbench.element_test.start import UnusedScalarError

    given = [] if start.pressure is None else [f"--p0 {start.pressure:g}"]
    given += [f"{_start_option(name)}{value:g}" for name, value in start.scalars.items()]
    lead = f"{', '.join(given)}: " if given else ""
    try:
        yield
    except MissingScalarError as error:
        value = "X" if error.name in START_OPTIONS else "VALUE"
        raise ModelError(
            f"{lead}the model needs {error.name!r} at the start of a path; give it with "
            f"{_start_option(error.name)}{value}"
        ) from error
    except UnusedScalarError as error:
        raise ConfigurationError(
            f"{_start_option(error.name).rstrip(' =')} is given, but {error.model} does not use "
            "it; leave it out"
        ) from error
    except ConfigurationError as error:
        raise ConfigurationError(f"{lead}{error}") from error
    except ModelError as error:
        raise ModelError(f"{lead}{error}") from error


def _start_option(name: str) -> str:
    """The option that gives a scalar at the start, up to where its value begins."""
    return f"{START_OPTIONS[name]} " if name in START_OPTIONS else f"--start {name}="


@contextmanager
def _named_options(options: Sequence[str]) -> Iterator[None]:
    """Name the options that were given in an error about what they set."""
    try:
        yield
    except ConfigurationError as error:
        lead = f"{' and '.join(options)}: " if options else ""
        raise ConfigurationError(f"{lead}{error}") from error


@contextmanager
def _training_command() -> Iterator[None]:
    """Name the command that trains a baseline in the error that it has to be trained first."""
    from granbench.cells.find import UntrainedBaselineError

    try:
        yield
    except UntrainedBaselineError as error:
        raise ModelError(
            f"baseline {error.name!r} has to be trained first: run `granbench train {error.name} "
            "--out DIR` and give DIR"
        ) from error
