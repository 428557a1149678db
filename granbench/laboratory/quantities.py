"""The quantities that a laboratory file may hold, and the headers by which they are known.

A stress may be effective or total. `axial_stress`, `intermediate_stress`, `radial_stress` and
`mean_stress` are those of which the header says neither; `effective_axial_stress`,
`total_axial_stress` and so on are those of which it does. The deviatoric stress is the same in
both.
"""

import re
import unicodedata
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


_STRESSES: Mapping[str, Quantity] = {
    "axial_stress": _quantity(
        "axial stress",
        "axialstress sigma1 sig1 s1 sigma11 sig11 sigmaa siga sigax sigmaax sigmaaxial s11 sa "
        "majorprincipalstress majorstress axialspannung axialespannung vertikalspannung "
        "verticalstress sigmav sigv sigmaz sigz sigmazz vertspannung sigmavertical "
        "contrainteaxiale contrainteverticale contrainteprincipalemajeure esfuerzoaxial "
        "esfuerzovertical tensionaxial tensionvertical sforzoassiale",
        is_stress=True,
    ),
    "intermediate_stress": _quantity(
        "intermediate principal stress",
        "intermediatestress intermediateprincipalstress sigma2 sig2 s2 sigma22 sig22 s22",
        is_stress=True,
    ),
    "radial_stress": _quantity(
        "lateral stress",
        "radialstress lateralstress horizontalstress minorprincipalstress minorstress sigma3 sig3 "
        "s3 sigma33 sig33 s33 sr sigmar sigr sigrad sigmarad sigmaradial sigmah sigh "
        "radialspannung "
        "radialespannung horizontalspannung seitenspannung seitendruck contrainteradiale "
        "contraintelaterale contraintehorizontale contrainteprincipalemineure esfuerzoradial "
        "esfuerzolateral tensionradial",
        is_stress=True,
    ),
    "mean_stress": _quantity(
        "mean stress",
        "meanstress p pmean meanprincipalstress meannormalstress mittlerespannung "
        "mittlerenormalspannung mittelspannung contraintemoyenne pressionmoyenne esfuerzomedio "
        "tensionmedia sigmam sigm octahedralnormalstress octahedralstress",
        is_stress=True,
    ),
}

EFFECTIVE = (
    "effective effektive effektiver effektives effektiven effektiv wirksame wirksamer wirksamen "
    "wirksam efectiva efectivo efficace effettiva effettivo eff"
)
TOTAL = "total totale totaler totalen totales totaux tot"
STATES: Mapping[str, str] = {
    **dict.fromkeys(EFFECTIVE.split(), "effective"),
    **dict.fromkeys(TOTAL.split(), "total"),
}
"""`effective` or `total`, by the words for them."""

WATER = ("pore_pressure", "excess_pore_pressure", "back_pressure")
"""Pressures of the pore water."""

QUANTITIES: Mapping[str, Quantity] = {
    "axial_strain": _quantity(
        "axial strain",
        "axialstrain eps1 epsilon1 e1 eps11 epsa epsilona epsax epsaxial epsilonaxial epax ea "
        "verticalstrain epsz epszz epsilonz epsilonzz epsvert axialdehnung axialedehnung "
        "axialstauchung axialestauchung stauchung vertikaldehnung vertikalstauchung "
        "deformationaxiale deformationverticale deformacionaxial deformacionvertical "
        "deformazioneassiale",
    ),
    "intermediate_strain": _quantity(
        "intermediate principal strain", "intermediatestrain eps2 epsilon2 eps22"
    ),
    "radial_strain": _quantity(
        "lateral strain",
        "radialstrain lateralstrain eps3 epsilon3 e3 eps33 epsr epsilonr epsrad epsradial er "
        "radialdehnung radialedehnung deformationradiale deformationlaterale deformacionradial",
    ),
    "volumetric_strain": _quantity(
        "volumetric strain",
        "volumetricstrain volumestrain volstrain volumestrainchange epsv epsilonv epv epsvol "
        "epsilonvol ev volumendehnung volumetrischedehnung volumenstauchung deformationvolumique "
        "deformationvolumetrique deformacionvolumetrica variationdevolume",
    ),
    "deviatoric_strain": _quantity(
        "deviatoric strain",
        "deviatoricstrain deviatorstrain shearstraininvariant epsq epsilonq epsdev epss eq "
        "deviatorischedehnung deformationdeviatorique",
    ),
    **_STRESSES,
    **{
        f"{state}_{name}": Quantity(f"{state} {about.title}", True, frozenset())
        for state in ("effective", "total")
        for name, about in _STRESSES.items()
    },
    "deviatoric_stress": _quantity(
        "deviatoric stress",
        "deviatoricstress deviatorstress deviatoric deviator q stressdifference "
        "principalstressdifference sigma1sigma3 sig1sig3 s1s3 sigmaasigmar sigmad sigd "
        "deviatorspannung deviatorischespannung spannungsdifferenz hauptspannungsdifferenz "
        "deviateur deviateurdescontraintes contraintedeviatorique contraintedeviatoire "
        "esfuerzodesviador esfuerzodesviatorico desviador tensiondesviadora deviatore",
        is_stress=True,
    ),
    "cell_pressure": _quantity(
        "cell pressure",
        "cellpressure cell cellpress sigmacell sigcell confiningpressure confiningstress "
        "confinement chamberpressure chamber zelldruck zellendruck kammerdruck manteldruck "
        "pressioncellulaire pressiondecellule pressiondeconfinement confinementpressure "
        "presiondecelda presiondecamara presiondeconfinamiento presionconfinante "
        "pressionedicella",
        is_stress=True,
    ),
    "pore_pressure": _quantity(
        "pore pressure",
        "porepressure porewaterpressure pwp porewater poropressure u uw waterpressure basepwp "
        "pwpbase basepressure basepore baseporepressure baseporewaterpressure midplanepwp "
        "midheightporepressure porepressurebase porepressureu porewaterpressureu "
        "porenwasserdruck porendruck pressioninterstitielle "
        "pressiondeau pressiondepore presiondeporo presiondeporos presiondelporo "
        "presionintersticial pressioneneutra pressioneinterstiziale",
        is_stress=True,
    ),
    "excess_pore_pressure": _quantity(
        "excess pore pressure",
        "excessporepressure excessporewaterpressure excesspwp epwp epp deltau deltapwp deltauw "
        "dpwp du duw ue uex uexcess excessu porepressurechange changeinporepressure "
        "changeofporepressure porewaterpressurechange changeinporewaterpressure changeinpwp "
        "pwpchange deltaporepressure deltaporewaterpressure porepressureincrement "
        "excessporepressuredeltau excessporewaterpressuredeltau porenwasseruberdruck "
        "porenwasserueberdruck porenuberdruck porenueberdruck surpressioninterstitielle "
        "surpressiondeau excesodepresiondeporos",
        is_stress=True,
    ),
    "back_pressure": _quantity(
        "back pressure",
        "backpressure backpress bp backp backwaterpressure sattigungsdruck saettigungsdruck "
        "ruckdruck rueckdruck contrepression contrapresion presiondecola contropressione",
        is_stress=True,
    ),
    "stress_ratio": _quantity("stress ratio q/p", "stressratio eta qoverp"),
    "void_ratio": _quantity(
        "void ratio",
        "voidratio e porenzahl indicedesvides indicedevides relaciondevacios indicedeporos",
    ),
}

_BOOKKEEPING = (
    # Words that are added to by a number or a unit are listed without them.
    "time dateovertime dateandtime elapsedtime testtime totaltime timeelapsed t datetime date "
    "timestamp clock hour hours "
    "minute minutes second seconds sec zeit uhrzeit datum dauer temps heure tiempo fecha hora "
    "squareroottime roottime sqrttime logtime roottimemin "
    "step steps stepno stepnumber stepid stage stages stageno stagenumber stagename phase phaseno "
    "cycle cycles cycleno cyclenumber n zyklus zyklen schritt stufe stufennr laststufe "
    "etape increment inc frame loadstep loadstepno "
    "no nr nbr number index id row line point points pointno reading readingno readings record "
    "recordno sample samplenumber scan scanno dataset datapoint messung messpunkt punkt zeile "
    "test testno testid testname specimen specimenid specimenno file filename operator project "
    "borehole remark remarks comment comments note notes bemerkung kommentar remarque "
    "temperature temp temperatur humidity roomtemperature battery"
)
BOOKKEEPING = frozenset(_BOOKKEEPING.split())
"""Headers, as `plain_header` gives them, of columns that no stress and no strain follows from."""

_DEFINITION = re.compile(r"=.*$")
_SYMBOL = r"(?:sigma|sig|s)_?"
_AXIAL = rf"{_SYMBOL}(?:11|1|axial|ax|aa|a|zz|z|v)"
_MIDDLE = rf"{_SYMBOL}(?:22|2)"
_LATERAL = rf"{_SYMBOL}(?:33|3|radial|rad|rr|r|h)"
_E_AXIAL, _E_MIDDLE, _E_LATERAL = (
    rf"(?:epsilon|eps|e)_?{label}" for label in ("(?:11|1|a|ax)", "(?:22|2)", "(?:33|3|r|rad)")
)
_THREE_P = rf"\({_AXIAL}\+(?:2\*?{_LATERAL}|{_MIDDLE}\+{_LATERAL})\)"
_CHANGE = r"(?:d|delta)"
_DEFINITIONS: Mapping[str, re.Pattern[str]] = {
    name: re.compile(pattern)
    for name, pattern in {
        "axial_strain": rf"{_CHANGE}_?(h|l|z)/\1_?(?:0|i|o)|\(?(h|l)_?0-\2\)?/\2_?0",
        "volumetric_strain": rf"{_CHANGE}_?v/v_?(?:0|i|o)|\(v_?0-v\)/v_?0"
        rf"|{_E_AXIAL}\+(?:2\*?{_E_LATERAL}|{_E_MIDDLE}\+{_E_LATERAL})",
        "deviatoric_strain": rf"(?:2/3\*?\({_E_AXIAL}-{_E_LATERAL}\)"
        rf"|2\*?\({_E_AXIAL}-{_E_LATERAL}\)/3)",
        "deviatoric_stress": rf"\(?{_AXIAL}-{_LATERAL}\)?",
        "mean_stress": rf"{_THREE_P}/3|1/3\*?{_THREE_P}",
        "stress_ratio": "q/p",
        "void_ratio": r"v_?v/v_?s",
        "excess_pore_pressure": r"uw?-(?:u_?0|bp|u_?b)",
    }.items()
}
"""What each quantity is by definition, in the form that `_means_the_same` compares."""
_TWO_STRESSES = re.compile(r"(?:sigma|sig|s)[1a](?:sigma|sig|s)[3r]")
_DIFFERENCE = re.compile("[-_\N{MINUS SIGN}\N{EN DASH}\N{HYPHEN}]")
_PRIMES = re.compile("['\u2019\u2032\u00b4`\u2018\u201b]")
_BRACKETS = re.compile(r"[(\[{][^)\]}]*[)\]}]")
_LETTERS = {
    "σ": "sigma", "ς": "sigma", "ε": "eps", "δ": "delta", "∆": "delta", "η": "eta", "γ": "gamma",
    "τ": "tau", "φ": "phi", "ν": "nu", "/": "over", "ß": "ss", "√": "sqrt", "+": "plus",
    "*": "times", "×": "times", "·": "times", "⋅": "times",
}  # fmt: skip


def plain_header(name: str) -> str:
    """A header's name as `Quantity.headers` has it: ``sigrad'`` and ``Sig_rad`` are `sigrad`.

    Greek letters are spelt out, accents and everything but letters and digits are left out.
    """
    text = unicodedata.normalize("NFKD", name).lower()
    return re.sub(r"[^a-z0-9]", "", "".join(_LETTERS.get(letter, letter) for letter in text))


def known_quantity(name: str) -> str | None:
    """The quantity that a header without its unit names, or None.

    Of a stress that the header calls effective (by a word or a prime) or total, it is the quantity
    with that word in front. A header may name the same twice, as in ``Axial strain, eps1``, or
    define it, as in ``q = s1 - s3``. Another definition, as in ``q = (s1 - s3)/2``, makes it
    another quantity, and so does a minus sign in front.
    """
    if name.lstrip("([{ ").startswith(("-", "\N{MINUS SIGN}", "\N{EN DASH}")):
        return None
    name, sign, definition = name.partition("=")
    if sign:
        found = known_quantity(name)
        return found if found and _means_the_same(found, definition) else None
    if found := _named(name):
        return found
    first, _, last = name.strip().rpartition(" ")
    for parts in (re.split(r"[,;:()\[\]]", name), (first, last)):
        named = [_named(part) for part in parts if plain_header(part)]
        if len(named) < 2 or None in named:
            continue
        quantities = {quantity for quantity in named if quantity is not None}
        # Where one part says that the stress is effective, the other need not.
        stated = {q for q in quantities if q != stress_of(q)} or quantities
        if len(stated) == 1 and len({stress_of(q) for q in quantities}) == 1:
            return stated.pop()
    return None


def _means_the_same(quantity: str, definition: str) -> bool:
    """Whether a definition is the usual one of a quantity, or names the quantity again."""
    if known_quantity(definition) == quantity:
        return True
    text = unicodedata.normalize("NFKD", definition).lower()
    text = "".join(_LETTERS.get(c, c) if c not in "/+*" else c for c in text)
    text = re.sub(r"[\s\[\]]|\u0301|\u0300", "", text.replace("\N{MINUS SIGN}", "-"))
    bare = _PRIMES.sub("", text)
    plain = stress_of(quantity)
    if bare != text and quantity == plain and plain in _STRESSES:
        return False  # effective on one side only
    if quantity.startswith("effective_") and bare == text:
        symbols = {"axial_stress": _AXIAL, "radial_stress": _LATERAL, "mean_stress": "p"}
        pattern = symbols.get(plain)
        if pattern and re.fullmatch(rf"{pattern}-uw?", text):
            return True
    usual = _DEFINITIONS.get(plain)
    return usual is not None and usual.fullmatch(bare) is not None


def _named(name: str) -> str | None:
    """The quantity of a header, or of a part of one, that names it once."""
    plain = plain_header(name)
    if _TWO_STRESSES.search(plain) and not _DIFFERENCE.search(name):
        return None
    primed = bool(_PRIMES.search(name))
    if found := _by_header(plain):
        return _with_state(found, "effective" if primed else None)
    # Longest first: `eff` is a part of `effective`.
    for word in sorted(STATES, key=len, reverse=True):
        if word not in plain:
            continue
        if found := _by_header(plain.replace(word, "", 1)):
            return _with_state(found, STATES[word], primed=primed)
    return None


def _by_header(plain: str) -> str | None:
    return next((name for name, about in QUANTITIES.items() if plain in about.headers), None)


def _with_state(quantity: str, state: str | None, *, primed: bool = False) -> str | None:
    """The quantity that is effective or total as the header says; None where that is nonsense."""
    if state is None or quantity == "deviatoric_stress":
        return quantity
    if state == "total" and primed:
        return None
    if quantity == "cell_pressure":
        return "effective_radial_stress" if state == "effective" else quantity
    if quantity in _STRESSES:
        return f"{state}_{quantity}"
    # `Total pore pressure` is the absolute one; a prime on a strain means nothing.
    if (quantity == "pore_pressure" and state == "total") or not QUANTITIES[quantity].is_stress:
        return quantity
    return None


def is_bookkeeping(name: str) -> bool:
    """Whether a header is one of `BOOKKEEPING`, numbered or not, brackets left aside."""
    return (
        plain_header(_BRACKETS.sub("", _DEFINITION.sub("", name))).rstrip("0123456789")
        in BOOKKEEPING
    )


def stress_of(quantity: str) -> str:
    """The name of a stress without `effective` or `total`."""
    return quantity.removeprefix("effective_").removeprefix("total_")


def listed(names: Iterable[str]) -> str:
    """Headers for an error text: ``'eps1 [%]', 'q'``, or `none`."""
    return ", ".join(repr(name) for name in names) or "none"
