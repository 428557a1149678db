"""Write the sections of the axes into docs/scoring.md.

Run ``python docs/scoring_page.py`` from the root of the checkout to write the sections of all
registered axes into the page; a test checks that they are up to date. With submissions as arguments
(``python docs/scoring_page.py j2.json ...``) it first writes the measured tables into the sections
(the file `section.md` in the folder of an axis).
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from page_parts import with_part, with_parts

from granbench.benchmark.registry import axes
from granbench.benchmark.section_file import section_path
from granbench.leaderboard.submission import Submission, read_submission

PAGE = Path(__file__).parent / "scoring.md"
OWN = "granbench"


def page() -> str:
    """Text of docs/scoring.md with the sections of GranBench's own axes."""
    sections = [axis.section() for axis in axes() if type(axis).__module__.startswith(OWN)]
    text = PAGE.read_text(encoding="utf-8")
    return with_part(text, "axes", "\n" + "\n".join(sections))


def write_measured_tables(submissions: Sequence[Submission]) -> None:
    """Write the measured tables of some models into the sections of the axes."""
    for axis in axes():
        if tables := axis.measured_tables(submissions):
            file = section_path(str(sys.modules[type(axis).__module__].__file__))
            text = file.read_text(encoding="utf-8")
            file.write_text(with_parts(text, tables), encoding="utf-8")


if __name__ == "__main__":
    if given := [read_submission(Path(name)) for name in sys.argv[1:]]:
        write_measured_tables(given)
    PAGE.write_text(page(), encoding="utf-8")
