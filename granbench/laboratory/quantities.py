"""The quantities that a laboratory file may hold, and the headers by which they are known."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """One measured quantity.

    Parameters
    ----------
    title : for people
    is_stress : whether it is a stress rather than a ratio
    headers : by which it is known, in the form that `plain_header` gives
    """

    title: str
    is_stress: bool
    headers: frozenset[str]


def _quantity(title: str, headers: str, *, is_stress: bool = False) -> Quantity:
    return Quantity(title, is_stress, frozenset(headers.split()))


QUANTITIES: Mapping[str, Quantity] = {
    "axial_strain": _quantity(
        "axial strain",
        "axialstrain eps1 epsilon1 e1 eps11 epsa epsilona epsax epsaxial epsilonaxial epax ea",
    ),
    "intermediate_strain": _quantity(
        "intermediate principal strain", "intermediatestrain eps2 epsilon2 eps22"
    ),
    "radial_strain": _quantity(
        "lateral strain",
        "radialstrain lateralstrain eps3 epsilon3 eps33 epsr epsilonr epsrad epsradial er",
    ),
    "volumetric_strain": _quantity(
        "volumetric strain", "volumetricstrain volumestrain epsv epsilonv epv epsvol ev"
    ),
    "deviatoric_strain": _quantity(
        "deviatoric strain", "deviatoricstrain epsq epsilonq epsdev epss eq"
    ),
    "axial_stress": _quantity(
        "axial stress",
        "axialstress sigma1 sig1 s1 sigma11 sig11 sigmaa siga sigax sigmaaxial",
        is_stress=True,
    ),
    "intermediate_stress": _quantity(
        "intermediate principal stress",
        "intermediatestress sigma2 sig2 s2 sigma22 sig22",
        is_stress=True,
    ),
    "radial_stress": _quantity(
        "lateral stress",
        "radialstress lateralstress cellpressure sigma3 sig3 s3 sigma33 sig33 sigmar sigr sigrad",
        is_stress=True,
    ),
    "deviatoric_stress": _quantity(
        "deviatoric stress", "deviatoricstress deviatorstress q", is_stress=True
    ),
    "mean_stress": _quantity("mean stress", "meanstress meaneffectivestress p", is_stress=True),
    "void_ratio": _quantity("void ratio", "voidratio e"),
}

_DEFINITION = re.compile(r"=.*$")


def plain_header(name: str) -> str:
    """A header's name as `Quantity.headers` has it: ``sigrad'`` and ``Sig_rad`` are `sigrad`."""
    return re.sub(r"[^a-z0-9]", "", _DEFINITION.sub("", name.lower()))


def known_quantity(name: str) -> str | None:
    """The quantity that a header without its unit names, or None."""
    plain = plain_header(name)
    for quantity, about in QUANTITIES.items():
        if plain in about.headers:
            return quantity
    return None


def listed(names: Iterable[str]) -> str:
    """Headers for an error text: ``'eps1 [%]', 'q'``, or `none`."""
    return ", ".join(repr(name) for name in names) or "none"
