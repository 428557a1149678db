"""Validate rows of the board again: the changed ones, or all of them.

A row has changed if it, apart from its seal, or a file beside it differs from an earlier commit. A
new version of the metrics that changes no value is applied to the earlier row first. Valid rows are
listed in a file, so that an interrupted run continues where it stopped.
"""

import json
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from granbench import __version__
from granbench.benchmark.evaluation_run import SeedProgress
from granbench.benchmark.metric import METRIC_VERSION
from granbench.errors import ConfigurationError, GranbenchError, SubmissionError
from granbench.files.whole_file import whole_file
from granbench.leaderboard.admission import examine
from granbench.leaderboard.rescoring import SAME_VALUES, rescored
from granbench.leaderboard.rows import Row, accepted
from granbench.leaderboard.sealing import require_seal, row_digest
from granbench.leaderboard.submission import Submission
from granbench.leaderboard.submitted_task import records_of, task_of

BRANCHES = ("origin/main", "main")


@dataclass(frozen=True)
class RowOutcome:
    """The result of validating one row.

    Parameters
    ----------
    file : of the row
    complaint : why it is not valid; None if it is
    known : whether an earlier run found it valid
    """

    file: Path
    complaint: str | None = None
    known: bool = False


def revalidate(
    rows: Sequence[Row],
    folder: Path,
    state: Path | None = None,
    progress: Callable[[Row], SeedProgress | None] | None = None,
) -> Iterator[RowOutcome]:
    """Validate rows one after the other.

    Parameters
    ----------
    rows : of the board
    folder : the board's
    state : file that lists valid rows; None for no such file
    progress : called with a row before it is validated, and gives the `progress` of `examine`

    Returns
    -------
    The outcome of each, one after the other
    """
    done = _read(state)
    for row in rows:
        try:
            digest = f"{METRIC_VERSION} {row_digest(row.submission, row.file.parent)}"
            if digest in done:
                yield RowOutcome(row.file, known=True)
                continue
            complaint = _complaint(row, folder, progress(row) if progress else None)
        except GranbenchError as error:
            complaint = str(error)
        if complaint is None and state is not None:
            done.add(digest)
            _write(state, done)
        yield RowOutcome(row.file, complaint)


def _complaint(row: Row, folder: Path, progress: SeedProgress | None) -> str | None:
    require_seal(row.submission, row.file)
    examination = examine(row.file, folder, progress=progress)
    stored = row.submission
    if examination.submission.badge != stored.badge:
        return f"{row.file}: its badge is {stored.badge!r}, not {examination.submission.badge!r}"
    accepted_with_reason = stored.acceptance is not None and stored.acceptance.word is not None
    for objection in examination.objections:
        if objection.flagged and not accepted_with_reason:
            return f"{row.file}: {objection.text}"
    return None


def touched(folder: Path, since: str | None = None) -> list[Row]:
    """The rows of a board in a git checkout that differ from an earlier commit.

    Parameters
    ----------
    folder : the board's
    since : commit to compare with; by default where the branch left `main`, or on `main` itself the
        commit before

    Raises
    ------
    ConfigurationError
        If the board is not in a git checkout, or there is no such commit.
    """
    top = Path(_git(folder, "rev-parse", "--show-toplevel"))
    base = _commit(folder, since)
    if base is None:
        return accepted(folder)  # the first commit: everything is new
    inside = folder.resolve().relative_to(top.resolve())
    changed = _git(top, "diff", "--name-only", "-z", base, "--", str(inside)).split("\0")
    new = _git(top, "ls-files", "--others", "--exclude-standard", "-z", "--", str(inside))
    names = {name for name in [*changed, *new.split("\0")] if name}
    return [row for row in accepted(folder) if _differs(row, top, base, names)]


def _differs(row: Row, top: Path, base: str, names: set[str]) -> bool:
    place = row.file.resolve().relative_to(top.resolve())
    beside = (str(place.with_suffix(".nc")), f"{place.with_suffix('.model')}/")
    if any(name == beside[0] or name.startswith(beside[1]) for name in names):
        return True
    if str(place) not in names:
        return False
    try:
        content = json.loads(_git(top, "show", f"{base}:{place.as_posix()}"))
        before = Submission.model_validate(content)
    except (ConfigurationError, ValueError):
        return True
    return _unsealed(_of_this_version(before, row)) != _unsealed(row.submission)


def _of_this_version(before: Submission, row: Row) -> Submission:
    """The earlier row under this version of the metrics, where that needs no predictions."""
    if before.metric_version not in SAME_VALUES:
        return before
    task = task_of(before, row.file)
    with records_of(task, row.file) as records:
        return rescored(before, row.file, records, task)


def _unsealed(submission: Submission) -> Submission:
    """The row without its digest, but with a maintainer's reason."""
    acceptance = submission.acceptance
    word = acceptance.word if acceptance else None
    if acceptance is None or word is None:
        return submission.model_copy(update={"acceptance": None})
    return submission.model_copy(
        update={"acceptance": acceptance.model_copy(update={"digest": "0" * 64})}
    )


def _commit(folder: Path, since: str | None) -> str | None:
    if since is not None:
        return _git(folder, "rev-parse", "--verify", f"{since}^{{commit}}")
    head = _git(folder, "rev-parse", "HEAD")
    for branch in BRANCHES:
        try:
            base = _git(folder, "merge-base", "HEAD", branch)
        except ConfigurationError:
            continue
        if base != head:
            return base
    try:
        return _git(folder, "rev-parse", "--verify", "HEAD~1")
    except ConfigurationError:
        return None


def _git(folder: Path, *arguments: str) -> str:
    command = ["git", "-C", str(folder), *arguments]
    try:
        done = subprocess.run(command, check=True, capture_output=True, text=True)
    except FileNotFoundError as error:
        raise ConfigurationError("git is missing; install it to find changed rows") from error
    except subprocess.CalledProcessError as error:
        first = (error.stderr.strip().splitlines() or ["no reason given"])[0]
        raise ConfigurationError(
            f"git {arguments[0]} failed in {folder} ({first}); name a commit of this checkout"
        ) from error
    return done.stdout.strip()


def _read(state: Path | None) -> set[str]:
    if state is None or not state.exists():
        return set()
    try:
        content = json.loads(state.read_text(encoding="utf-8"))
        valid = content["valid"]
        return set(map(str, valid)) if content["granbench"] == __version__ else set()
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise ConfigurationError(
            f"{state} is not a list of validated rows ({error}); remove it to start again"
        ) from error


def _write(state: Path, done: set[str]) -> None:
    content = {"granbench": __version__, "valid": sorted(done)}
    with whole_file(state, SubmissionError) as partial:
        partial.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
