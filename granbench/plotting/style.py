"""One look for every figure: truth as dots, model as line, one colour one model, grey-proof.

Figures are built on `matplotlib.figure.Figure` itself, never on pyplot, so that drawing one
changes nothing anywhere else and needs no screen.
"""

import io
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser
from matplotlib.text import Text

from granbench.errors import ConfigurationError
from granbench.files.whole_file import whole_file

PANEL_SIZE = (3.5, 2.9)
"""Width and height of one panel, inches: two make a column of A4."""

RESOLUTION = 130
"""Dots per inch of a saved PNG: sharp in a page, some 100 kB."""

UNDATED: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
}
"""Formats of a saved figure, and what matplotlib must leave out for the same bytes every time."""

SALT = "granbench"
"""Without one matplotlib names the parts of an SVG at random."""

SETTINGS: dict[Any, Any] = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 10.0,
    "font.size": 9.0,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "text.usetex": False,
}

house_style = mpl.rc_context(SETTINGS)
"""Decorator of every function that draws: `SETTINGS` hold while it runs, and nowhere else."""

TRUTH: dict[str, Any] = {
    "color": "0.25",
    "linestyle": "none",
    "marker": "o",
    "markersize": 2.6,
    "markeredgewidth": 0.0,
}
"""Keywords of `Axes.plot` for ground truth."""

MODEL_COLOURS = (
    "#0072b2",
    "#d55e00",
    "#009e73",
    "#cc79a7",
    "#e69f00",
    "#56b4e9",
    "#5d3a9b",
    "#8c564b",
)
"""Distinct for colour-blind readers too; the line style goes with the colour, for grey print."""
LINE_STYLES: tuple[Any, ...] = (
    "-",
    "--",
    "-.",
    (0, (1, 1)),
    (0, (5, 1, 1, 1, 1, 1)),
    (0, (3, 3)),
    (0, (8, 2)),
    (0, (1, 3)),
)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<")
PALETTE_START = 14466
"""Start value of the CRC that places a name in the palette: with it the first eight baselines
of the benchmark fall on eight places."""


@dataclass(frozen=True)
class ModelStyle:
    """Style of one model on every page.

    Parameters
    ----------
    colour : hexadecimal
    linestyle : what matplotlib takes
    marker : where points are drawn
    """

    colour: str
    linestyle: Any
    marker: str

    def line(self) -> dict[str, Any]:
        """Keywords of `Axes.plot`."""
        return {"color": self.colour, "linestyle": self.linestyle}


def model_styles(names: Iterable[str]) -> dict[str, ModelStyle]:
    """A style for each model of a page.

    The place in the palette comes from the name alone, so a model looks the same on every
    page. Only where two names of one page fall on the same place, the later in the alphabet
    takes the next free one.
    """
    taken: set[int] = set()
    styles = {}
    count = len(MODEL_COLOURS)
    for name in sorted(set(names)):
        place = zlib.crc32(name.encode(), PALETTE_START) % count
        while place in taken and len(taken) < count:
            place = (place + 1) % count
        taken.add(place)
        styles[name] = ModelStyle(MODEL_COLOURS[place], LINE_STYLES[place], MARKERS[place])
    return styles


def figure_grid(
    rows: int = 1,
    columns: int = 1,
    *,
    panel: tuple[float, float] = PANEL_SIZE,
    share_x: bool = False,
    share_y: bool = False,
) -> tuple[Figure, list[Axes]]:
    """An empty figure and its axes, row by row; call it under `house_style`.

    Parameters
    ----------
    rows, columns : panels
    panel : width and height of one, inches
    share_x, share_y : whether panels of one column (row) share their axis
    """
    figure = Figure(figsize=(panel[0] * columns, panel[1] * rows), layout="constrained")
    axes = figure.subplots(
        rows,
        columns,
        squeeze=False,
        sharex="col" if share_x else False,
        sharey="row" if share_y else False,
    )
    return figure, list(axes.ravel())


def ordered_colours(values: Sequence[float] | np.ndarray) -> tuple[list[Any], Any]:
    """Colours that grow darker or lighter with a quantity, and the map for a colour bar.

    Parameters
    ----------
    values : (n,), any unit, finite

    Returns
    -------
    colours : (n,), of `cividis`, whose lightness rises evenly: it reads in grey
    mappable : for `Figure.colorbar`
    """
    numbers = np.asarray(values, dtype=float)
    low, high = (float(numbers.min()), float(numbers.max())) if numbers.size else (0.0, 1.0)
    if high <= low:
        high = low + (abs(low) or 1.0)
    # The palest tenth of the map is too light for dots on white.
    palette = mpl.colormaps["cividis"].resampled(256)
    colours = palette(np.linspace(0.0, 0.9, 256))
    scale = mpl.cm.ScalarMappable(
        Normalize(low, high), mpl.colors.ListedColormap(colours, name="cividis-without-palest")
    )
    return [scale.to_rgba(number) for number in numbers], scale


def figure_format(path: Path) -> str:
    """The format that the name of a figure's file asks for: png, pdf or svg.

    Raises
    ------
    ConfigurationError
        If the name ends in anything else.
    """
    name = path.suffix.removeprefix(".").lower()
    if name not in UNDATED:
        raise ConfigurationError(
            f"{path}: cannot be written, for a figure is a .png, .pdf or .svg file; end its name "
            "in one of them"
        )
    return name


def _make_drawable(figure: Figure) -> None:
    """Keep texts that come from files, such as names of tests, from ending the drawing.

    Mathematics that matplotlib cannot parse is shown as it is written; control characters and
    bytes of a file name that are no text are shown as a replacement character.
    """
    parser: Any = MathTextParser("path")
    texts: list[Any] = figure.findobj(Text)
    for text in texts:
        written = text.get_text()
        shown = "".join(
            letter if letter == "\n" or letter.isprintable() else "\N{REPLACEMENT CHARACTER}"
            for letter in written
        )
        if shown != written:
            text.set_text(shown)
        if "$" in shown:
            try:
                parser.parse(shown)
            except ValueError:
                text.set_parse_math(False)


def save_figure(figure: Figure, path: Path | str) -> Path:
    """Write a figure in the format that the file's name ends in, whole or not at all.

    Raises
    ------
    ConfigurationError
        If the format is unknown (see `figure_format`) or the folder cannot be written.
    """
    path = Path(path)
    kind = figure_format(path)
    _make_drawable(figure)
    with (
        whole_file(path, ConfigurationError) as partial,
        mpl.rc_context({"svg.hashsalt": SALT}),
    ):
        figure.savefig(partial, format=kind, dpi=RESOLUTION, metadata=UNDATED[kind])
    return path


def figure_svg(figure: Figure) -> str:
    """A figure as the text of an SVG file, with its words as text and no date in it.

    The same figure always gives the same text.
    """
    _make_drawable(figure)
    written = io.StringIO()
    settings: dict[Any, Any] = {
        "svg.hashsalt": SALT,
        "svg.fonttype": "none",
        "font.sans-serif": ["DejaVu Sans"],
    }
    with mpl.rc_context(settings):
        metadata = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        figure.savefig(written, format="svg", metadata=metadata)
    return written.getvalue()
