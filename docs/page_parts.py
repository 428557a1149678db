"""Functions that put text between the markers of a page, and that write small pictures.

A page has the two lines ``<!-- NAME:begin -->`` and ``<!-- NAME:end -->``; the text between them is
written by a script, the rest by hand.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

from granbench.plotting import save_figure

COLOURS = 64
"""Size of a picture's palette: enough for lines and their soft edges, in a third of the bytes."""


def markers(name: str) -> tuple[str, str]:
    """The lines before and after a part."""
    return f"<!-- {name}:begin -->", f"<!-- {name}:end -->"


def with_part(page: str, name: str, text: str) -> str:
    """The page with the text between the markers of the part.

    Raises
    ------
    ValueError
        If the page does not have each of the two markers once.
    """
    begin, end = markers(name)
    if page.count(begin) != 1 or page.count(end) != 1:
        raise ValueError(f"the page must have {begin} and {end} once each; add what is missing")
    before, rest = page.split(begin)
    _, after = rest.split(end)
    return f"{before}{begin}\n{text}\n{end}{after}"


def with_parts(page: str, parts: Mapping[str, str]) -> str:
    """The page with the text of each part between its markers."""
    for name, text in parts.items():
        page = with_part(page, name, text)
    return page


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def write_picture(figure: Figure, path: Path, colours: int = COLOURS) -> Path:
    """Write a figure as PNG with a palette; the same figure always gives the same bytes."""
    save_figure(figure, path)
    with Image.open(path) as picture:
        small = picture.convert("RGB").quantize(colours, dither=Image.Dither.NONE)
    small.save(path, optimize=True)
    return path
