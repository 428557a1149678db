"""The columns of a path file: which components they prescribe."""

from collections.abc import Sequence
from difflib import get_close_matches

from granbench.errors import ConfigurationError
from granbench.tensors import COMPONENT_ORDERS

STRAIN, STRESS = "eps_", "sig_"


DRIVING_COLUMNS = ("eps_axial", "eps_shear")


KNOWN_COLUMNS = (
    *(
        prefix + label
        for prefix in (STRAIN, STRESS)
        for label in sorted({label for own in COMPONENT_ORDERS.values() for label in own})
    ),
    *DRIVING_COLUMNS,
)


def component_label(column: str) -> str:
    """The component of a column, such as ``xx`` for ``eps_xx``."""
    return column.removeprefix(STRAIN).removeprefix(STRESS)


def columns_of_orders() -> str:
    """The names of the strain columns of every component order, for error texts."""
    return " or ".join(
        ",".join(STRAIN + label for label in labels) for labels in COMPONENT_ORDERS.values()
    )


def _hint(name: str, known: Sequence[str]) -> str:
    """A hint to the known column that an unknown one may mean; empty if there is none."""
    label = name.lower().removeprefix("gamma").lstrip("_")
    if name.lower().startswith("gamma") and STRAIN + label in known:
        return f"give the tensor component {STRAIN}{label}, which is half of {name}: "
    near = get_close_matches(name.lower(), known, n=1)
    return f"did you mean {near[0]}? " if near else ""


def checked_columns(names: Sequence[str], source: str) -> tuple[str, ...]:
    """The names of the columns, checked to be those of one component order or a driving strain.

    Parameters
    ----------
    names : from the header, in lower case where they are known
    source : the file, for error texts

    Raises
    ------
    ConfigurationError
        Naming the column that is unknown, missing, or prescribes a component twice.
    """
    known = KNOWN_COLUMNS
    for number, name in enumerate(names, start=1):
        if name not in known:
            hint = _hint(name, known)
            raise ConfigurationError(
                f"{source}: column {number} of the header is {name!r}, which is unknown: {hint}"
                f"name the columns {columns_of_orders()}, separated by commas or blanks"
            )
    if driving := [name for name in names if name in DRIVING_COLUMNS]:
        if len(names) > 1:
            raise ConfigurationError(
                f"{source}: column {driving[0]} drives a standard test and must be the only "
                "column; remove the others, or name the strain components"
            )
        return tuple(names)
    found = [component_label(name) for name in names]
    for label in found:
        if found.count(label) > 1:
            twice = [name for name in names if component_label(name) == label]
            raise ConfigurationError(
                f"{source}: columns {' and '.join(twice)} prescribe one component twice; keep one"
            )
    # `plane` is a part of `full`: the smallest order that holds all labels is meant.
    orders = [own for own in COMPONENT_ORDERS.values() if set(found) <= set(own)]
    if not orders:
        raise ConfigurationError(
            f"{source}: columns {','.join(names)} mix component orders; name them "
            f"{columns_of_orders()}"
        )
    if missing := [label for label in min(orders, key=len) if label not in found]:
        raise ConfigurationError(
            f"{source}: column {STRAIN}{missing[0]} (or {STRESS}{missing[0]}) is missing; name the "
            f"columns {columns_of_orders()}"
        )
    return tuple(names)
