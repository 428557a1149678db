"""Sections of docs/scoring.md that stand in a file beside their axis."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from granbench.benchmark.axis import Axis
from granbench.benchmark.metric import Metric
from granbench.data.markdown import table

SECTION_FILE = "section.md"
METRICS = "{{metrics}}"


def section_path(module: str) -> Path:
    """The file with the section of an axis, beside the module that defines it (`__file__`)."""
    return Path(module).with_name(SECTION_FILE)


def section_file(axis: Axis, module: str, **parts: str) -> str:
    """The text of `section.md` beside a module, with its tables as the code makes them.

    Parameters
    ----------
    axis : whose section it is; `{{metrics}}` in the text becomes the table of its metrics
    module : file of the module, its `__file__`
    parts : what further names in double braces become
    """
    text = section_path(module).read_text(encoding="utf-8")
    text = text.replace(METRICS, metrics_table(axis.metrics()))
    for name, content in parts.items():
        text = text.replace(f"{{{{{name}}}}}", content)
    return text


def metrics_table(metrics: Sequence[Metric]) -> str:
    """What every metric is; neighbours that share a definition share a row."""
    rows = []
    for definition, group in groupby(metrics, lambda metric: metric.definition):
        members = list(group)
        rows.append(
            (
                _names([member.name for member in members]),
                definition,
                members[0].unit,
                members[0].direction,
                _of_truth(members[0]),
            )
        )
    return table(("metric", "definition", "unit", "better", "the ground truth has"), rows)


def _names(names: Sequence[str]) -> str:
    """Names, of which the later ones are shortened to what follows the common beginning."""
    first, *others = (name.replace("{component}", "XX") for name in names)
    stem = first.rpartition("_")[0]
    short = (name.removeprefix(stem) if name.startswith(f"{stem}_") else name for name in others)
    return ", ".join(f"`{name}`" for name in (first, *short))


def _of_truth(metric: Metric) -> str:
    if metric.of_truth is None:
        return "–"
    if metric.tolerance.clock is not None:
        return f"{metric.of_truth:g}, up to the clock"
    return "exactly 0" if metric.of_truth == 0.0 else f"{metric.of_truth:g}"
