"""Write the generated parts of the pages on classical models, and their figures.

Run ``python docs/model_pages.py`` from the root of the checkout; `make docs` does this. A test
checks that the pages are up to date.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from model_curves import EVIDENCE, Comparison, Evidence
from page_parts import table, with_parts, write_picture

from granbench.cells import Conditions
from granbench.models import MODELS, ClassicalCell, Parameter
from granbench.paths.mixed_control import isotropic_stress
from granbench.plotting.model import model_figure
from granbench.records.schema import SCHEMA
from granbench.tensors import COMPONENT_ORDERS

MODEL_PAGES = Path(__file__).parent / "models"
START_PRESSURE = 1e5
SMALLEST_SHOWN = 1e-6
"""Smallest relative difference that is shown as a number."""


@dataclass(frozen=True)
class Summary:
    """Text about a model in the index, in addition to the attributes of the model.

    Parameters
    ----------
    pressure : how its strength depends on the mean stress
    hardening : quantity that moves its yield surface
    thesis : section of the thesis
    """

    pressure: str
    hardening: str
    thesis: str


SUMMARIES: Mapping[str, Summary] = {
    "j2": Summary("no", "none", "6.6.2, 7.6.1"),
    "drucker-prager": Summary("yes", "none", "6.6.2"),
    "j2-hardening": Summary("no", "plastic strain", "6.6.2"),
    "ime": Summary("no", "plastic strain", "5.2.1, 7.3.1"),
    "enhanced-ime": Summary("yes", "plastic shear strain, compaction", "7.3.2"),
    "csuh": Summary("yes, and on density", "plastic volume change, by state", "5.2.1, 7.4"),
    "modified-cam-clay": Summary("yes, and on density", "plastic volume change", "see 7.4"),
}

GREEK = ("sigma", "lambda", "kappa", "chi", "nu")


def mathematics(symbol: str) -> str:
    """Symbol of a parameter, such as `eps_0p`, as inline mathematics."""
    base, _, index = symbol.partition("_")
    if base in GREEK:
        base = f"\\{base}"
    elif base == "eps":
        base = r"\varepsilon"
    elif len(base) > 1:
        base = rf"\mathrm{{{base}}}"
    return f"${base}_{{{index}}}$" if index else f"${base}$"


def limits(parameter: Parameter) -> str:
    """Open range of a parameter, as text."""
    low, high = parameter.lower, parameter.upper
    if math.isinf(low) and math.isinf(high):
        return "any"
    if math.isinf(high):
        return f"> {low:g}"
    return f"{low:g} … {high:g}, both excluded"


def parameter_part(model: type[ClassicalCell]) -> str:
    """Table of the parameters with their meanings and ranges."""
    rows = [
        (f"`{one.name}`", mathematics(one.symbol), one.units, one.meaning, limits(one))
        for one in model.parameter_table
    ]
    return table(("parameter", "symbol", "unit", "meaning", "range"), rows)


def set_part(model: type[ClassicalCell]) -> str:
    """Table of the values of all published sets."""
    names = [f"`{name}`" for name in model.parameter_sets]
    names[0] += " (default)"
    rows = [
        (f"`{one.name}`", *(f"{values[one.name]:.6g}" for values in model.parameter_sets.values()))
        for one in model.parameter_table
    ]
    return table(("parameter", *names), rows)


def state_part(model: type[ClassicalCell]) -> str:
    """Table of the state in plane components, with its values at an isotropic stress."""
    cell = model(order="plane")
    with torch.no_grad():
        start = torch.from_numpy(isotropic_stress(START_PRESSURE, "plane"))[None]
        state = cell.initial_state(Conditions(start))[0]
    stress = [(f"stress {label}", "Pa", "stress") for label in COMPONENT_ORDERS["plane"]]
    internals = [(f"`{name}`", *_unit_and_meaning(name)) for name in cell.internals]
    rows = [
        (*named, f"{float(value) + 0.0:.6g}")
        for named, value in zip([*stress, *internals], state, strict=True)
    ]
    return table(("state", "unit", "meaning", "at an isotropic 100 kPa"), rows)


def _unit_and_meaning(name: str) -> tuple[str, str]:
    if name in SCHEMA:
        return SCHEMA[name].units, SCHEMA[name].long_name
    meaning = re.sub(r"_(x|y|z)(x|y|z)$", r" \1\2", name).replace("_", " ")
    return ("Pa" if "stress" in name or "pressure" in name else "1"), meaning


def comparison_part(evidence: Evidence) -> str:
    """Table that compares numbers of the drawn curves with their closed forms."""
    rows = [
        (
            one.what,
            f"${one.formula}$",
            f"{one.closed_form:.4g} {one.unit}".removesuffix(" 1"),
            f"{one.model:.4g} {one.unit}".removesuffix(" 1"),
            _difference(one),
        )
        for one in evidence.comparisons
    ]
    return table(("", "closed form", "value", "model", "difference"), rows)


def _difference(comparison: Comparison) -> str:
    difference = comparison.difference
    if difference < SMALLEST_SHOWN:
        return "below 0.0001 %"
    return f"{100.0 * difference:.2g} %"


def model_page(name: str, evidence: Evidence) -> str:
    """Text of the page of a model."""
    model = MODELS[name]
    parts = {
        "parameters": parameter_part(model),
        "sets": set_part(model),
        "state": state_part(model),
        "comparisons": comparison_part(evidence),
    }
    return with_parts(_read(MODEL_PAGES / f"{name}.md"), parts)


def models_index() -> str:
    """Text of the index of the models."""
    rows = [
        (
            f"[`{name}`]({name}.md)",
            model.title,
            "plane" if model.dimension == 2 else "space",
            SUMMARIES[name].pressure,
            SUMMARIES[name].hardening,
            ", ".join(mathematics(parameter.symbol) for parameter in model.parameter_table),
            SUMMARIES[name].thesis,
        )
        for name, model in MODELS.items()
    ]
    header = ("model", "what it is", "defined in", "strength depends on pressure", "hardening",
              "parameters", "thesis section")  # fmt: skip
    return with_parts(_read(MODEL_PAGES / "README.md"), {"models": table(header, rows)})


def _read(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def main() -> None:
    """Write every page and figure."""
    for name, run in EVIDENCE.items():
        evidence = run()
        (MODEL_PAGES / f"{name}.md").write_text(model_page(name, evidence), encoding="utf-8")
        write_picture(model_figure(evidence.panels), MODEL_PAGES / f"{name}.png")
    (MODEL_PAGES / "README.md").write_text(models_index(), encoding="utf-8")


if __name__ == "__main__":
    main()
