"""The model beside a submission: write its files, copy them, and load them to run it again.

A model's files hold only data: the parameters of a classical model, or the trained weights of a
baseline of GranBench. The code that runs them is GranBench's own; no user code is imported.
"""

import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import xarray as xr

from granbench.cells.baseline import BASELINES, DESCRIPTION_FILE
from granbench.cells.find import FoundModel, cells_of_baseline, find_cells
from granbench.errors import GranbenchError, SubmissionError
from granbench.leaderboard.submission import ModelFile, ModelReference, file_digest
from granbench.models import MODELS
from granbench.models.classical import ClassicalCell
from granbench.models.parameter_file import write_parameters

PARAMETERS = "parameters.json"
TRAINED_FILES = (DESCRIPTION_FILE, "model.safetensors", PARAMETERS)
"""Files that a trained baseline may have; others in its folder belong to the training."""


def require_data_only(candidate: FoundModel) -> None:
    """Make sure that a model can be run again from data and the code of GranBench.

    Raises
    ------
    SubmissionError
        If it needs code of its own.
    """
    if candidate.baseline is not None:
        _require_own(candidate.baseline.name)
    else:
        _classical(candidate)


def _classical(candidate: FoundModel) -> ClassicalCell:
    """The one classical model of all seeds; SubmissionError if it is anything else."""
    cell = candidate.cell
    one_for_all = all(other is cell for other in candidate.cells.values())
    # The registered class itself: a class derived from it, or a plug-in's, is other code.
    own = MODELS.own(cell.name) and type(cell) is MODELS[cell.name]
    if isinstance(cell, ClassicalCell) and own and one_for_all:
        return cell
    raise SubmissionError(
        f"{candidate.name} cannot be run again from data alone: it is neither a baseline of "
        "GranBench nor a classical model with one set of parameters; keep its predictions"
    )


def export(candidate: FoundModel, folder: Path, name: str) -> ModelReference:
    """Write the files of a model beside a submission.

    Parameters
    ----------
    candidate : the model
    folder : the submission's
    name : of the model's own folder in it, made when it has files

    Returns
    -------
    The reference to them in the submission

    Raises
    ------
    SubmissionError
        See `require_data_only`.
    """
    require_data_only(candidate)
    if candidate.baseline is not None:
        copied = [
            (seed, _copied(place / file, folder / name / str(seed) / file))
            for seed, place in candidate.folders.items()
            for file in TRAINED_FILES
            if (place / file).is_file()
        ]
        return ModelReference(
            baseline=candidate.baseline.name,
            files=tuple(_described(path, folder, seed) for seed, path in copied),
        )
    (folder / name).mkdir(exist_ok=True)
    file = write_parameters(_classical(candidate), folder / name / PARAMETERS)
    return ModelReference(files=(_described(file, folder, None),))


def _require_own(baseline: str) -> None:
    if not BASELINES.own(baseline):
        raise SubmissionError(
            f"{baseline!r} is not a baseline of GranBench itself, and no other code is run; keep "
            "its predictions"
        )


def _copied(source: Path, target: Path) -> Path:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)
    return target


def _described(file: Path, folder: Path, seed: int | None) -> ModelFile:
    return ModelFile(
        path=file.relative_to(folder).as_posix(),
        seed=seed,
        sha256=file_digest(file),
        bytes=file.stat().st_size,
    )


def moved(reference: ModelReference, folder: Path, target: Path, name: str) -> ModelReference:
    """Copy a model's files from one submission's folder to another's.

    Parameters
    ----------
    reference : the model
    folder : where its paths begin
    target : where the new ones do
    name : of the model's own folder there, which is replaced

    Returns
    -------
    The model with its new paths
    """
    shutil.rmtree(target / name, ignore_errors=True)
    files = []
    for file in reference.files:
        path = "/".join([name, *file.path.split("/")[1:]])
        _copied(folder / file.path, target / path)
        files.append(file.model_copy(update={"path": path}))
    return reference.model_copy(update={"files": tuple(files)})


@contextmanager
def restored(
    reference: ModelReference, submission: Path, seeds: Sequence[int], records: xr.Dataset
) -> Iterator[FoundModel]:
    """Load the model of a submission, as it was evaluated, from its files.

    Parameters
    ----------
    reference : the model
    submission : the JSON file that it lies beside
    seeds : that it was evaluated for
    records : the whole dataset of the task

    Raises
    ------
    SubmissionError
        If a file is missing, damaged or not the one that was submitted, or the baseline is not
        GranBench's own.
    """
    if reference.baseline is not None:
        _require_own(reference.baseline)
    for file in reference.files:
        _check(file, submission)
    with tempfile.TemporaryDirectory() as private:
        # The model is loaded from copies of the files that were checked.
        for file in reference.files:
            _copied(submission.parent / file.path, _place(file, Path(private)))
        try:
            candidate = _candidate(reference, Path(private), seeds, records)
        except GranbenchError as error:
            text = str(error).replace(f"{private}/", "")
            raise SubmissionError(f"{submission}: its model cannot be loaded: {text}") from error
        yield candidate


def _check(file: ModelFile, submission: Path) -> None:
    path = submission.parent / file.path
    if path.name not in TRAINED_FILES:
        raise SubmissionError(
            f"{submission}: {file.path} is not a file of a model; those are "
            f"{', '.join(TRAINED_FILES)}"
        )
    if not path.is_file():
        raise SubmissionError(
            f"{submission}: the model's file {file.path} is missing; put it beside the submission"
        )
    if path.stat().st_size != file.bytes or file_digest(path) != file.sha256:
        raise SubmissionError(
            f"{submission}: {file.path} does not have the size and SHA-256 that the submission "
            "states; submit the model that was evaluated"
        )


def _place(file: ModelFile, folder: Path) -> Path:
    name = Path(file.path).name
    return folder / name if file.seed is None else folder / str(file.seed) / name


def _candidate(
    reference: ModelReference, folder: Path, seeds: Sequence[int], records: xr.Dataset
) -> FoundModel:
    if reference.baseline is None:
        return find_cells(str(_place(reference.files[0], folder)), records, seeds=seeds)
    trained = {file.seed: folder / str(file.seed) for file in reference.files}
    _require_seeds(trained, seeds)
    return cells_of_baseline(
        reference.baseline, records, folders=list(trained.values()), seeds=seeds
    )


def _require_seeds(trained: Mapping[int | None, Path], seeds: Sequence[int]) -> None:
    if trained and list(trained) != list(seeds):
        raise SubmissionError(
            f"seeds are {list(seeds)}, but its files belong to {list(trained)}; they must agree"
        )
