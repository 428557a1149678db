"""Pictures that commands draw; a failure to draw leaves the results untouched."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from granbench.cli.printing import note
from granbench.errors import ConfigurationError, GranbenchError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@contextmanager
def drawing_errors(file: Path) -> Iterator[None]:
    """Raise any exception from drawing a picture as an error that names the picture.

    Raises
    ------
    GranbenchError
        One that is raised inside, as it is; anything else as ConfigurationError.
    """
    try:
        yield
    except GranbenchError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split()) or "no reason is given"
        raise ConfigurationError(
            f"the picture {file} cannot be drawn ({type(error).__name__}: {reason}); check the "
            "installation of matplotlib, or draw the data with another program"
        ) from error


def draw_picture(file: Path, draw: Callable[[], "Figure"]) -> Path:
    """Draw a picture and write it.

    Parameters
    ----------
    file : to write; its name ends in the format
    draw : makes the figure, including the imports for it

    Raises
    ------
    GranbenchError
        See `drawing_errors`.
    """
    with drawing_errors(file):
        from granbench.plotting.style import save_figure

        return save_figure(draw(), file)


def draw_beside_results(file: Path, draw: Callable[[], "Figure"]) -> Path | None:
    """Draw a picture of results that are written already; a failure is a note on stderr.

    Returns
    -------
    The file, or None if the picture could not be drawn.
    """
    try:
        return draw_picture(file, draw)
    except GranbenchError as error:
        note(f"{error}. The results are complete without it")
        return None
