"""Statements about stresses, strains and drainage in the lines above a table.

Laboratories write the back pressure, the drainage and the sign above the table. None of it is read
as a number; if the settings do not cover what such a line says, the file is refused with the line
and the setting that answers it.
"""

import re
import unicodedata
from collections.abc import Mapping

from granbench.errors import DatasetError, Setting
from granbench.laboratory.measured import Measured
from granbench.laboratory.quantities import WATER
from granbench.laboratory.remedies import kind as kind_is
from granbench.laboratory.remedies import pressure, stresses
from granbench.laboratory.settings import ImportSettings
from granbench.tables.tables import Table

LONGEST_LINE = 2000
"""Characters of a line that are searched."""
LONGEST_QUOTE = 100

UNMARKED = ("axial_stress", "intermediate_stress", "radial_stress", "mean_stress")
"""Stresses whose header says neither effective nor total."""

_STRESS = (
    r"(?:stress|pressure|spannung|contrainte|\bpression|esfuerzo|\btension|\bpresion|sforz|sigma)"
)
_TOTAL = re.compile(
    rf"\btot(?:al[a-z]*|aux)?\b.*{_STRESS}|{_STRESS}.*\btot(?:al[a-z]*|aux)?\b|^\W*total\w*\W*$"
    r"|(?:total|gesamt)spannung"
)
_WATER = re.compile(
    r"\bback ?(?:water ?)?press|\bu ?0\b|\buo\b|\bb\.?p\b|\bcell ?press|\bchamber ?press"
    r"|\bpore ?(?:water ?|fluid ?)?press|\bwater ?press|\bsaturation ?press|\bpwp\b"
    r"|gegendruck|s(?:a|ae)tt(?:igungs|\. ?)druck|r(?:u|ue)ckdruck|wasserdruck|porendruck"
    r"|zell(?:en)?druck|kammerdruck"
    r"|contre ?pression|pression (?:interstitielle|cellulaire|de (?:la )?cellule|d.eau)"
    r"|contra ?pres(?:ion|sao)|poro ?pressao|pressao (?:neutra|confinante)"
    r"|presion de (?:cola|poros?|celda|camara)|presion intersticial"
    r"|contro ?pressione|pressione (?:interstiziale|di cella|neutra)"
)
_UNDRAINED = re.compile(
    r"\bun ?drain|\bnon ?(?:drain|drenat)|\b(?:no|nao) ?drenad|\bcu (?:tri|test|versuch)|\bundran"
    r"|\bnicht (?:drain|entwass)|\bohne drain"
    r"|\bdrain(?:age|ed|iert)\W+(?:no|none|off|closed|nein)\b"
)
_UNDRAINED_NAMES = re.compile(
    r"(?<![A-Za-z])(?:TX[- ]?)?(?:C[IA]?U|CK[0oO]U|UU)(?:TX|TC|TE|C|E)?(?![A-Za-z])"
    r"(?!\s*(?:[\[(]-[\])])?\s*[=:;,]?\s*\d+[.,]\d)"
)
"""Names of undrained tests; ``CU = 2.1`` is a coefficient of uniformity."""
_TENSION = re.compile(
    r"(?:tension|tensile|zug|traction|traccion|trazione)[a-z]*"
    r"(?: (?:stress|strain|spannung)[a-z]*)?\W+(?:(?:is|are|as|counted|ist|sind|est|es|e)\W+)*"
    r"(?:\+|posit)"
    r"|\bposit[a-z]* +(?:(?:in|im|for|bei|en) +)*(?:tension|extension|zug|traction|traccion)"
    r"|(?:\bcompress[a-z]*|\bdruck[a-z]*|\bcompresion)(?: (?:stress|strain)[a-z]*)?"
    r"\W+(?:(?:is|are|as|counted|ist|est|es)\W+)*negat"
    r"|\bnegat[a-z]* +(?:(?:in|im|for|bei|en) +)*(?:compress|druck)"
)
_STRAIN = r"(?:strain|dehnung|deformation|deformacion|deformazion)"
_LOGARITHM = r"(?:logarithmi|logarithmique|logaritmic|natural|naturelle|hencky|\btrue\b|vraie)"
_LOGARITHMIC = re.compile(
    rf"{_LOGARITHM}.*{_STRAIN}|{_STRAIN}.*{_LOGARITHM}|\bhencky\b|\blog\.? ?strain|\bln strain"
    r"|\blogarith?m(?!\w* (?:scale|time|axis|plot))|wahre dehnung"
    rf"|{_STRAIN}\w*\W+(?:ln|log)\b|verdadera"
)


def refuse_unanswered_lines(
    table: Table, measured: Mapping[str, Measured], settings: ImportSettings
) -> None:
    """Refuse a line above the table about stress, sign or strain that no setting covers.

    Raises
    ------
    DatasetError
        Quoting the line and naming the setting that answers it.
    """
    ambiguous = settings.stresses is None and any(name in measured for name in UNMARKED)
    dry = settings.back_pressure is None and not any(name in measured for name in WATER)
    for number, text in table.preamble:
        plain = _plain(text)
        if ambiguous and _TOTAL.search(plain):
            raise _unanswered(
                table, number, text, "whether the stresses of the table are total or effective",
                stresses("total"), " with ", pressure("back_pressure"), ", or ",
                stresses("effective"),
            )  # fmt: skip
        if ambiguous and dry and _WATER.search(plain):
            raise _unanswered(
                table, number, text, "a water pressure, but no column of the table has one",
                stresses("effective"), " if the stresses are effective already, or ",
                stresses("total"), " with ", pressure("back_pressure"),
            )  # fmt: skip
        if not settings.tension_positive and _TENSION.search(plain):
            raise _unanswered(
                table, number, text, "which sign is positive", Setting("tension_positive", True)
            )
        if settings.strain_measure == "engineering" and _LOGARITHMIC.search(plain):
            raise _unanswered(
                table, number, text, "which measure of strain the table has",
                Setting("strain_measure", "logarithmic"),
            )  # fmt: skip


def refuse_undrained_lines(kind: str, table: Table, settings: ImportSettings) -> None:
    """Refuse another kind of test if a line above the table says it was undrained.

    Raises
    ------
    DatasetError
        Quoting the line and naming the setting that answers it.
    """
    if settings.kind is not None or kind == "triaxial-undrained":
        return
    for number, text in table.preamble:
        if _UNDRAINED.search(_plain(text)) or _UNDRAINED_NAMES.search(text[:LONGEST_LINE]):
            raise _unanswered(
                table, number, text, "how the test was drained, but the numbers are those of "
                f"the kind {kind}", kind_is("triaxial-undrained"), " or ", kind_is(kind),
            )  # fmt: skip


def _unanswered(
    table: Table, number: int, text: str, about: str, *remedy: str | Setting
) -> DatasetError:
    row = table.places[0].split()[0]  # `line` of a text, `row` of a sheet
    quoted = " ".join(text.split())[:LONGEST_QUOTE]
    return DatasetError(
        f"{table.source}, {row} {number}: {quoted!r} says {about}; give ",
        *remedy,
        f", or fix the {row}",
    )


def _plain(text: str) -> str:
    """A line in small letters without accents, hyphens and underscores."""
    letters = unicodedata.normalize("NFKD", text[:LONGEST_LINE]).lower()
    without = "".join(letter for letter in letters if not unicodedata.combining(letter))
    return re.sub(r"[-_\u2010-\u2014]+", " ", without.replace("σ", "sigma"))
