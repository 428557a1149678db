"""Settings that answer the questions a laboratory file leaves open, for error texts."""

from granbench.errors import Blank, Setting

HEADER, PASCALS, QUANTITY = Blank("HEADER"), Blank("PA"), Blank("QUANTITY")


def column(quantity: str, header: str = HEADER) -> Setting:
    """The setting that says which column holds a quantity."""
    return Setting("columns", {quantity: header})


def unit(quantity: str, name: str) -> Setting:
    """The setting that gives the unit of a quantity, or of all that are a stress or a strain."""
    return Setting("units", {quantity: name})


def ignore(*headers: str) -> Setting:
    """The setting that leaves out columns."""
    return Setting("ignore", headers)


def kind(name: str) -> Setting:
    """The setting that gives the kind of test."""
    return Setting("kind", name)


def stresses(state: str) -> Setting:
    """The setting that says whether the stresses are `effective` or `total`."""
    return Setting("stresses", state)


def pressure(name: str) -> Setting:
    """The setting that gives a pressure in Pa, such as `back_pressure`."""
    return Setting(name, PASCALS)
