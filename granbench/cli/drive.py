"""`granbench drive`: take a model through an element test or along a path of one's own."""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from granbench.cli.options import refuse_overwriting, require_writable
from granbench.errors import ConfigurationError

if TYPE_CHECKING:
    from torch import Tensor

    from granbench.cell import MaterialCell
    from granbench.driven_model import ModelChoice, Start
    from granbench.driving import Answer, Course
    from granbench.paths.strain_files import PathTable

DEFAULT_STRAIN = 0.2
DEFAULT_STEPS = 200


def drive(
    model: Annotated[
        str,
        typer.Argument(
            help="Classical model such as j2 or its parameter file, baseline, folder of a trained "
            "model, or package.module:factory of a cell."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="CSV or netCDF (.nc) file to write.")],
    path: Annotated[
        Path | None,
        typer.Option("--path", help="CSV of strains (and stresses), or records in netCDF."),
    ] = None,
    control: Annotated[
        str | None,
        typer.Option("--control", help="Standard test, such as triaxial-drained or oedometer."),
    ] = None,
    strain: Annotated[
        float | None,
        typer.Option("--strain", help="Driving strain at the test's end; 0.2, negative extends."),
    ] = None,
    turning_points: Annotated[
        str | None,
        typer.Option("--turning-points", help="Driving strains at which it turns, as 0.02,-0.02."),
    ] = None,
    steps: Annotated[int | None, typer.Option("--steps", help="Of a test; 200.")] = None,
    b: Annotated[
        float | None, typer.Option("--b", help="Intermediate stress ratio of a triaxial test; 0.")
    ] = None,
    params: Annotated[
        Path | None, typer.Option("--params", help="Parameters (JSON) as `granbench fit` writes.")
    ] = None,
    parameter_set: Annotated[
        str | None, typer.Option("--set", help="Published parameters of a classical model.")
    ] = None,
    p0: Annotated[
        float | None, typer.Option("--p0", metavar="PA", help="Isotropic stress at the start; 1e5.")
    ] = None,
    ocr: Annotated[
        float | None, typer.Option("--ocr", help="Overconsolidation ratio at the start.")
    ] = None,
    e0: Annotated[float | None, typer.Option("--e0", help="Void ratio at the start.")] = None,
    start: Annotated[
        list[str] | None,
        typer.Option("--start", metavar="NAME=VALUE", help="Else known, as grading_index=1.06."),
    ] = None,
    order: Annotated[
        str | None,
        typer.Option("--order", help="Components of a classical model: principal, plane or full."),
    ] = None,
    task: Annotated[
        str, typer.Option("--task", help="Dataset that a baseline without training is fitted to.")
    ] = "dem-triaxial-mini",
    tolerance: Annotated[
        float | None,
        typer.Option("--tolerance", help="Of held stresses, relative; 1e-9, in float32 1.2e-5."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Picture to draw as well (.png, .pdf or .svg).")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON instead of a sentence.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Drive a model along a path, or through a standard test, and write its stresses."""
    from granbench.driven_model import ModelChoice, Start
    from granbench.driving import drive as take
    from granbench.plotting.element_test import element_test_figure
    from granbench.plotting.style import save_figure

    _check_targets(out, plot)
    for option, file in (("MODEL", Path(model)), ("--path", path), ("--params", params),
                         ("--task", Path(task))):  # fmt: skip
        refuse_overwriting(out, option, file)
    asked = _Asked(path, control, strain, turning_points, steps, b, order)
    choice = ModelChoice(model, parameter_set, params, task)
    cell, course, state = asked.prepared(choice, Start(p0, start_scalars(e0, ocr, start)))
    points = len(course.control.driven)
    if out.suffix == ".csv" and points > 1:
        raise ConfigurationError(
            f"--out {out}: a CSV file holds one path, but {path} has {points}; end its name in .nc"
        )
    configuration = {
        "model": model if ":" in model else Path(model).name,
        "parameters": _parameters(cell),
        "course": control or (path and path.name),
    }
    with _bar(course.control.steps - 1, cell.name, quiet or as_json) as advance:
        answer = take(
            cell, course, state, configuration=configuration, tolerance=tolerance, on_step=advance
        )
    _write(answer, out)
    if plot is not None:
        save_figure(element_test_figure(answer.records, cell.name, course.component), plot)
    if as_json:
        typer.echo(json.dumps(_summary(answer, cell, out, plot), indent=2))
    elif not quiet:
        typer.echo(_sentence(answer, cell, out))


@dataclass(frozen=True)
class _Asked:
    """The path or test that the options name."""

    path: Path | None
    control: str | None
    strain: float | None
    turning_points: str | None
    steps: int | None
    b: float | None
    order: str | None

    def prepared(
        self, choice: "ModelChoice", start: "Start"
    ) -> tuple["MaterialCell", "Course", "Tensor"]:
        """The cell, what it is taken along, and its state (point, n_state) at the start."""
        if self.path is not None and self.path.suffix == ".nc":
            return self._along_records(choice, start)
        from granbench.paths.strain_files import read_path

        table = None if self.path is None else read_path(self.path)
        if table is not None and table.driving_column is None:
            return self._along_table(table, choice, start)
        return self._through_test(table, choice, start)

    def _along_records(
        self, choice: "ModelChoice", start: "Start"
    ) -> tuple["MaterialCell", "Course", "Tensor"]:
        from granbench.data.adapters import conditions_of
        from granbench.driving import Course
        from granbench.records import open_records
        from granbench.tensors import component_order

        self._refuse_test_options()
        with open_records(self.path or "") as opened:
            records = opened.load()
        cell = choice.cell(component_order(tuple(str(c) for c in records["component"].values)))
        course = Course.of_records(records, str(self.path), cell)
        return cell, course, start.state(cell, conditions_of(records))

    def _along_table(
        self, table: "PathTable", choice: "ModelChoice", start: "Start"
    ) -> tuple["MaterialCell", "Course", "Tensor"]:
        from granbench.driving import Course

        self._refuse_test_options()
        cell = choice.cell(table.order)
        state = start.state(cell)
        stress = state[0, cell.layout["stress"]].double().numpy()
        return cell, Course.of_table(table, stress, cell), state

    def _through_test(
        self, table: "PathTable | None", choice: "ModelChoice", start: "Start"
    ) -> tuple["MaterialCell", "Course", "Tensor"]:
        from granbench.driving import Course, cell_for_test
        from granbench.paths.standard_tests import find_test, strain_history

        if self.control is None:
            raise ConfigurationError(
                f"{self.path}: column {table.driving_column} drives a standard test; add --control "
                "NAME"
                if table
                else "there is nothing to follow; give --control NAME, or --path FILE with strains"
            )
        test = find_test(self.control)
        if self.b is not None and not 0.0 <= self.b <= 1.0:
            raise ConfigurationError(f"--b {self.b:g} must lie in [0, 1]")
        if table is None:
            corners = _numbers("--turning-points", self.turning_points)
            end = DEFAULT_STRAIN if self.strain is None else self.strain
            for option, driven in (("--strain", [end]), ("--turning-points", corners)):
                _check_driving(option, driven)
            steps = DEFAULT_STEPS if self.steps is None else self.steps
            history = strain_history([*corners, end], steps)
        else:
            self._refuse(
                ("--strain", self.strain),
                ("--turning-points", self.turning_points),
                ("--steps", self.steps),
                why=f"{self.path} gives the driving strain",
            )
            history = table.history()
        pressure = start.isotropic_pressure("a standard test")
        programme = test.programme(pressure, float(abs(history).max()), self.b)
        column = "eps_shear" if programme.driving_component == "xy" else "eps_axial"
        if table is not None and table.driving_column != column:
            raise ConfigurationError(
                f"{self.path}: column {table.driving_column} does not drive {self.control}; name "
                f"it {column}"
            )
        cell = cell_for_test(choice, programme, self.order)
        course = Course.of_test(self.control, programme, history, cell.order, table)
        return cell, course, start.state(cell)

    def _refuse_test_options(self) -> None:
        self._refuse(
            ("--control", self.control), ("--strain", self.strain),
            ("--turning-points", self.turning_points), ("--steps", self.steps), ("--b", self.b),
            ("--order", self.order), why=f"{self.path} prescribes every component",
        )  # fmt: skip

    @staticmethod
    def _refuse(*options: tuple[str, object], why: str) -> None:
        for option, value in options:
            if value is not None:
                raise ConfigurationError(f"{option} is given, but {why}; leave one of them out")


def _check_targets(out: Path, plot: Path | None) -> None:
    """Refuse files that cannot be written before anything is computed."""
    from granbench.plotting.style import figure_format

    if out.suffix not in (".csv", ".nc"):
        raise ConfigurationError(f"--out {out}: end its name in .csv or .nc")
    require_writable("--out", out)
    if plot is not None:
        figure_format(plot)
        require_writable("--plot", plot)


def start_scalars(
    e0: float | None, ocr: float | None, start: Sequence[str] | None
) -> dict[str, float]:
    """What is known at the start beside the pressure, under dataset names."""
    given = [("initial_void_ratio", e0), ("overconsolidation_ratio", ocr)]
    for text in start or ():
        name, sign, number = text.partition("=")
        if not (sign and name.isidentifier()):
            raise ConfigurationError(f"--start {text!r}: give NAME=VALUE, as grading_index=1.06")
        given.append((name, _numbers(f"--start {name}", number)[0]))
    scalars: dict[str, float] = {}
    for name, value in given:
        if name in scalars:
            raise ConfigurationError(f"{name} at the start is given twice; leave one out")
        if value is not None:
            scalars[name] = value
    if "initial_void_ratio" in scalars and "overconsolidation_ratio" in scalars:
        raise ConfigurationError("--e0 and --ocr both set the density at the start; give one")
    return scalars


def _numbers(option: str, text: str | None) -> list[float]:
    try:
        return [float(part) for part in text.split(",")] if text is not None else []
    except ValueError as error:
        raise ConfigurationError(f"{option} {text!r} is not a number or a list of them") from error


def _check_driving(option: str, strains: Sequence[float]) -> None:
    from granbench.plausible import LARGEST_STRAIN

    for strain in strains:
        if not math.isfinite(strain):
            raise ConfigurationError(f"{option} {strain:g} is not a finite number; mend it")
        if abs(strain) > LARGEST_STRAIN:
            raise ConfigurationError(
                f"{option} {strain:g} is beyond {LARGEST_STRAIN:g}; strain has no unit: write 0.2 "
                "for 20 %"
            )


def _parameters(cell: "MaterialCell") -> dict[str, float] | None:
    from granbench.models import ClassicalCell

    return cell.values() if isinstance(cell, ClassicalCell) else None


def _write(answer: "Answer", out: Path) -> None:
    from granbench.paths.strain_files import write_answer
    from granbench.records import write_records

    if out.suffix == ".nc":
        write_records(answer.records, out)
    else:
        write_answer(out, answer.order, *answer.rows())


def _summary(
    answer: "Answer", cell: "MaterialCell", out: Path, plot: Path | None
) -> dict[str, object]:
    """What a program wants to know: files, size, and where each path ends."""
    from granbench.plotting.element_test import path_invariants

    p, q, volumetric = path_invariants(answer.records)
    return {
        "model": cell.name,
        "order": cell.order,
        "parameters": _parameters(cell),
        "out": str(out),
        "plot": None if plot is None else str(plot),
        "paths": answer.records.sizes["path"],
        "rows": answer.records.sizes["step"] - answer.added,
        "mean_stress": p[:, -1].tolist(),
        "deviatoric_stress": q[:, -1].tolist(),
        "largest_deviatoric_stress": q.max(axis=1).tolist(),
        "volumetric_strain": volumetric[:, -1].tolist(),
        "most_increments_in_a_step": int(answer.test.increments.max()),
    }


def _sentence(answer: "Answer", cell: "MaterialCell", out: Path) -> str:
    from granbench.plotting.element_test import path_invariants

    sizes = answer.records.sizes
    rows = f"{out}: {sizes['step'] - answer.added} rows of {cell.name}"
    if sizes["path"] > 1:
        return f"{rows} along each of {sizes['path']} paths"
    (p,), (q,), (volumetric,) = path_invariants(answer.records)
    return (
        f"{rows}; at the end p = {p[-1] / 1e3:.4g} kPa, q = {q[-1] / 1e3:.4g} kPa, volumetric "
        f"strain {100.0 * volumetric[-1]:.3g} %; largest q {q.max() / 1e3:.4g} kPa"
    )


@contextmanager
def _bar(steps: int, name: str, hidden: bool) -> Iterator[Callable[[int], None]]:
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    )  # fmt: skip
    hidden = hidden or not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as progress:
        job = progress.add_task(f"driving {name}", total=steps)
        yield lambda step: progress.update(job, completed=step)
