"""The card of a dataset: a page with design, figures, quality and splits, computed from its file.

``python -m granbench.data.card FILE --out FOLDER`` writes ``NAME-VERSION.md`` and a folder of
figures next to it.
"""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
import xarray as xr

from granbench.data.card_text import card_text
from granbench.errors import DatasetError, GranbenchError
from granbench.files.whole_file import whole_file
from granbench.plotting import (
    critical_state_figure,
    cyclic_figure,
    dataset_figure,
    increment_figure,
    pi_plane_figure,
    preparation_figure,
    quality_figure,
    save_figure,
    strain_path_figure,
    stress_space_figure,
)
from granbench.records import open_records, verify
from granbench.tensors import component_order

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURES: dict[str, tuple[Callable[[xr.Dataset], "Figure"], str]] = {
    "stress-strain": (
        dataset_figure,
        "Stress ratio and void ratio against axial strain, for specimens of one grading that "
        "differ only in density.",
    ),
    "critical-state": (
        critical_state_figure,
        "Void ratio against mean stress at the end of the monotonic tests; the lines are "
        "e = e_c0 − λ_c (p/p_a)^0.7, fitted to each grading.",
    ),
    "pi-plane": (
        pi_plane_figure,
        "Peak and critical stresses in the deviatoric plane, divided by p.",
    ),
    "preparation": (
        preparation_figure,
        "Initial void ratio against preparation friction, converted to the same mean stress with "
        "a compression line fitted within specimens.",
    ),
    "cyclic": (
        cyclic_figure,
        "Hysteresis of cyclic tests, from the densest to the loosest specimen.",
    ),
    "quality": (
        quality_figure,
        "Cumulative distribution of the control errors and of the inertial number over the paths.",
    ),
}

PLANE_FIGURES: dict[str, tuple[Callable[[xr.Dataset], "Figure"], str]] = {
    "paths": (
        strain_path_figure,
        "Strain and stress components along the first path of the training split and of every "
        "split out of distribution.",
    ),
    "increments": (
        increment_figure,
        "Cumulative distribution of the norm of the strain increments, by split.",
    ),
    "stress-space": (
        stress_space_figure,
        "Mean and deviatoric stress along the paths of the training split and of the splits out "
        "of distribution.",
    ),
}
"""Figures of drawn strain paths in the plane, instead of `FIGURES`."""


def write_card(records: xr.Dataset, out: Path) -> Path:
    """Write the page and its figures.

    Parameters
    ----------
    records : sealed stress-strain records
    out : folder for the page; the figures go to a folder in it that has the page's name

    Returns
    -------
    The page.

    Raises
    ------
    DatasetError
        If the folder cannot be written.
    """
    name = f"{records.attrs['dataset']}-{records.attrs['version']}"
    order = component_order(records["component"].values)
    drawn, undrawn = {}, {}
    for title, (draw, caption) in (PLANE_FIGURES if order == "plane" else FIGURES).items():
        try:
            figure = draw(records)
        except DatasetError as error:  # the dataset has no tests for this figure
            undrawn[title] = str(error)
            continue
        drawn[f"{name}/{save_figure(figure, out / name / f'{title}.png').name}"] = caption
    page = out / f"{name}.md"
    with whole_file(page, DatasetError) as partial:
        partial.write_text(card_text(records, drawn, undrawn), encoding="utf-8")
    return page


def _main(
    file: Annotated[Path, typer.Argument(help="Sealed netCDF file of records.")],
    out: Annotated[Path, typer.Option(help="Folder for the page.")],
) -> None:
    """Write the card of a dataset."""
    try:
        with open_records(file) as records:
            verify(records, str(file))
            typer.echo(write_card(records.load(), out))
    except GranbenchError as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(2) from error


if __name__ == "__main__":
    typer.run(_main)
