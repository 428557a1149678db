"""Options that several commands have in common, as types of their arguments.

``{models}`` in a help text stands for the registered names, see `granbench.cli.generated_help`.
"""

from pathlib import Path
from typing import Annotated

import typer

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables or sentences.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Plot = Annotated[Path | None, typer.Option("--plot", help="Picture to draw (.png, .pdf or .svg).")]

MODEL_HELP = (
    "Classical model ({models}) or its parameter file, baseline ({baselines}), folder of a trained "
    "model, or package.module:factory of a cell."
)

Params = Annotated[
    Path | None,
    typer.Option("--params", help="Parameters of a classical model (JSON), from `granbench fit`."),
]
ParameterSet = Annotated[
    str | None,
    typer.Option(
        "--set",
        help="Name of a published parameter set of a classical model.",
    ),
]
OverconsolidationRatio = Annotated[
    float | None, typer.Option("--ocr", help="Overconsolidation ratio at the start.")
]
InitialVoidRatio = Annotated[float | None, typer.Option("--e0", help="Void ratio at the start.")]
InitialScalars = Annotated[
    list[str] | None,
    typer.Option(
        "--start",
        metavar="NAME=VALUE",
        help="Another quantity at the start, such as grading_index=1.06.",
    ),
]
