"""`granbench fit`: fit a classical model to your own laboratory tests."""

from collections.abc import Sequence
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from granbench.cli.fit_tables import result_tables, understanding_of_tests
from granbench.cli.fitted_tests import require_shear, selected_tests
from granbench.cli.laboratory_options import (
    named_columns,
    named_numbers,
    named_texts,
)
from granbench.cli.model_options import one_model
from granbench.cli.options import (
    refuse_overwriting,
    require_folder,
    require_one_of,
    seed_option,
)
from granbench.cli.pictures import draw_beside_results
from granbench.cli.printing import print_json, say, show
from granbench.cli.progress import progress_bar
from granbench.cli.termination import stopped_by_sigterm
from granbench.errors import ConfigurationError
from granbench.files.folder_lock import locked_folder
from granbench.files.whole_file import whole_folder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from granbench.fitting import Fit
    from granbench.laboratory import LaboratoryTest

PARAMETERS = "parameters.json"
RECORDS = "tests.nc"


def fit(
    model: Annotated[str, typer.Argument(help="Classical model: {models}.")],
    data: Annotated[
        list[str],
        typer.Option(
            "--data",
            metavar="FILE[::TEST]",
            help="Laboratory file: CSV, .dat, .xlsx, .npz, or records in netCDF, once for each; "
            "::TEST selects one test of several.",
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="Folder for the results.")],
    leave_out: Annotated[
        list[str] | None,
        typer.Option(
            "--leave-out",
            metavar="FILE|TEST",
            help="Predict this file, or this test of --data, without fitting it.",
        ),
    ] = None,
    free: Annotated[
        str | None, typer.Option("--free", help="Parameters to fit, such as a,b,c; all by default.")
    ] = None,
    parameter_set: Annotated[
        str | None, typer.Option("--set", help="Published parameters to start from.")
    ] = None,
    params: Annotated[
        Path | None, typer.Option("--params", help="Parameters (JSON) to start from.")
    ] = None,
    control: Annotated[
        str,
        typer.Option(
            "--control",
            help="strain: prescribe the measured strain. mixed: prescribe the axial strain and the "
            "lateral stress. auto: mixed if the lateral strain was free in the test.",
        ),
    ] = "auto",
    points: Annotated[
        int,
        typer.Option(
            "--points", min=5, max=100_000, help="Number of points to which each test is thinned."
        ),
    ] = 60,
    weight: Annotated[
        list[str] | None,
        typer.Option("--weight", metavar="NAME=X", help="Weight of a quantity; 1 by default."),
    ] = None,
    starts: Annotated[
        int, typer.Option("--starts", min=1, max=1000, help="Number of starts of the search.")
    ] = 8,
    spread: Annotated[
        float,
        typer.Option(
            "--spread", min=0.0, max=5.0, help="Spread of the starts; 1 is a factor of 2.7."
        ),
    ] = 0.5,
    seed: Annotated[int, seed_option("Seed of starts and bootstrap.")] = 0,
    iterations: Annotated[
        int,
        typer.Option(
            "--iterations",
            min=1,
            max=1_000_000,
            help="Largest number of iterations of the Levenberg-Marquardt method.",
        ),
    ] = 60,
    bootstrap: Annotated[
        int,
        typer.Option(
            "--bootstrap",
            min=0,
            max=100_000,
            help="Number of bootstrap samples; 0 computes intervals from the curvature.",
        ),
    ] = 0,
    column: Annotated[
        list[str] | None,
        typer.Option(
            "--column",
            metavar="QUANTITY=HEADER",
            help="Header of a quantity, such as axial_strain=eps_ax or pore_pressure=PWP2.",
        ),
    ] = None,
    ignore: Annotated[
        list[str] | None,
        typer.Option("--ignore", metavar="HEADER", help="Leave out this column of the files."),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(
            "--unit",
            metavar="QUANTITY=UNIT",
            help="Unit of a quantity, such as stress=kPa or strain=%.",
        ),
    ] = None,
    kind: Annotated[
        str | None,
        typer.Option(
            "--kind",
            help="Kind of test, such as triaxial-undrained or oedometer; recognised from the file "
            "by default.",
        ),
    ] = None,
    stresses: Annotated[
        str | None,
        typer.Option(
            "--stresses",
            metavar="effective|total",
            help="Whether stresses are effective or total, if their headers do not say so.",
        ),
    ] = None,
    cell_pressure: Annotated[
        float | None,
        typer.Option(
            "--cell-pressure", metavar="PA", help="Constant cell pressure, if a file has none."
        ),
    ] = None,
    back_pressure: Annotated[
        float | None,
        typer.Option(
            "--back-pressure",
            metavar="PA",
            help="Pore pressure at the start, if a file does not give it.",
        ),
    ] = None,
    k0: Annotated[
        float,
        typer.Option(
            "--k0",
            help="Ratio of lateral to axial stress at the start of an oedometer test without "
            "measured lateral stress.",
        ),
    ] = 0.5,
    monotonic: Annotated[
        bool, typer.Option("--monotonic", help="Refuse an axial strain that decreases.")
    ] = False,
    tension_positive: Annotated[
        bool, typer.Option("--tension-positive", help="Tension is positive in the files.")
    ] = False,
    strain_measure: Annotated[
        str,
        typer.Option(
            "--strain-measure", help="Strain measure of the files: engineering or logarithmic."
        ),
    ] = "engineering",
    e0: Annotated[
        float | None, typer.Option("--e0", help="Initial void ratio, if a file has none.")
    ] = None,
    lateral_stress: Annotated[
        float | None,
        typer.Option(
            "--lateral-stress",
            metavar="PA",
            help="Constant effective lateral stress, if a file has none.",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Fit the parameters of a model to laboratory tests.

    The output folder then holds parameters.json (for `drive`, `evaluate` and `fem`), fit.json,
    curves.csv, fit.png and, if every test is complete, tests.nc: records on which any model can be
    scored. All files are written together at the end: an interrupted fit leaves the folder
    unchanged, and starts from the beginning when it is run again.

    The interpretation of each file is printed and kept in fit.json: kind of test, drainage, which
    stresses are effective and why, p0. If a file is ambiguous, an error asks what is meant.
    """
    require_folder("--out", out)

    from granbench.fitting import Effort, FitSettings
    from granbench.fitting import fit as fitted
    from granbench.fitting.report import PICTURE, report_of
    from granbench.fitting.settings import CONTROLS
    from granbench.laboratory import ImportSettings
    from granbench.models import find_model

    find_model(model)
    require_one_of("--control", control, CONTROLS)
    for text in (*data, *(leave_out or ())):
        file = Path(text.partition("::")[0])
        refuse_overwriting(out / RECORDS, f"--data {file}", file)
    reading = ImportSettings(
        columns=named_columns(column),
        units=named_texts("--unit", unit),
        ignore=tuple(ignore or ()),
        kind=kind,
        stresses=stresses,
        monotonic=monotonic,
        tension_positive=tension_positive,
        strain_measure=strain_measure,
        initial_void_ratio=e0,
        lateral_stress=lateral_stress,
        cell_pressure=cell_pressure,
        back_pressure=back_pressure,
        k0=k0,
    )
    settings = FitSettings(
        free=None if free is None else tuple(filter(None, map(str.strip, free.split(",")))),
        control=control,
        points=points,
        weights=named_numbers("--weight", weight),
        starts=starts,
        spread=spread,
        seed=seed,
        effort=Effort(iterations=iterations),
        bootstrap=bootstrap,
    )
    tests, left_out = selected_tests(data, leave_out or (), reading)
    cell: Any = one_model(model, parameter_set, params, order="principal").cell
    if settings.free is None:
        require_shear(tests, [parameter.name for parameter in cell.parameter_table])
    total = settings.effort.adam_iterations + settings.effort.iterations
    with (
        stopped_by_sigterm("to restart it"),
        locked_folder(out, ConfigurationError) if out.is_dir() else nullcontext(),
        whole_folder(out, ConfigurationError) as folder,
    ):
        with progress_bar(f"fitting {model}", total, shown="share", hidden=quiet or as_json) as bar:
            found = fitted(
                cell,
                tests,
                settings,
                left_out=left_out,
                on=lambda stage, _, cost: bar.advance(f"{model}, {stage}: cost {cost:.3g}"),
            )
        report = report_of(found, settings, tests, left_out)
        _write(found, report, tests, left_out, folder)
        if not (folder / RECORDS).exists():
            (out / RECORDS).unlink(missing_ok=True)  # of an earlier fit, to other tests
    picture = draw_beside_results(out / PICTURE, lambda: _figure(found))
    if picture is None:
        with suppress(OSError):
            (out / PICTURE).unlink(missing_ok=True)  # of an earlier fit
    if as_json:
        print_json(report | {"folder": str(out)})
    elif not quiet:
        for line in understanding_of_tests(report):
            say(line)
        show(*result_tables(report))
        for warning in report["warnings"]:
            say(f"note: {warning}")
        say(f"the parameters are in {out / PARAMETERS}")
        if picture is not None:
            say(f"the picture is in {picture}")


def _write(
    found: "Fit",
    report: dict[str, Any],
    tests: Sequence["LaboratoryTest"],
    left_out: Sequence["LaboratoryTest"],
    out: Path,
) -> None:
    from granbench.fitting.report import CURVES, REPORT, write_curves, write_report
    from granbench.laboratory import to_records
    from granbench.models.parameter_file import write_parameters
    from granbench.records import write_records

    write_report(report, out / REPORT)
    write_curves(found, out / CURVES)
    every = [*tests, *left_out]
    if all(test.is_complete for test in every):
        names = [test.name for test in left_out]
        write_records(to_records(every, left_out=names), out / RECORDS)
    # Written last: if it is there, so are the other results.
    write_parameters(found.cell, out / PARAMETERS)


def _figure(found: "Fit") -> "Figure":
    from granbench.plotting.fit import fit_figure

    return fit_figure({found.cell.name: found.curves})
