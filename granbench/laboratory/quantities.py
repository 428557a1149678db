"""The quantities of laboratory files, and the headers by which they are recognised.

A stress may be effective or total. `axial_stress`, `intermediate_stress`, `radial_stress` and
`mean_stress` are stresses whose header says neither; `effective_axial_stress`,
`total_axial_stress` and so on are those whose header does. The deviatoric stress is the same in
both.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """One measured quantity.

    Parameters
    ----------
    title : for people
    is_stress : whether it is a stress rather than a ratio
    headers : by which it is recognised, in the form of `granbench.laboratory.headers.plain_header`
    """

    title: str
    is_stress: bool
    headers: frozenset[str]


def _quantity(title: str, headers: str, *, is_stress: bool = False) -> Quantity:
    return Quantity(title, is_stress, frozenset(headers.split()))


BASE_STRESSES: Mapping[str, Quantity] = {
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
    **BASE_STRESSES,
    **{
        f"{state}_{name}": Quantity(f"{state} {about.title}", True, frozenset())
        for state in ("effective", "total")
        for name, about in BASE_STRESSES.items()
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
    # Words that may be followed by a number or a unit are listed without it.
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
"""Headers of columns without stress or strain, as `plain_header` gives them."""


def stress_of(quantity: str) -> str:
    """The name of a stress without `effective` or `total`."""
    return quantity.removeprefix("effective_").removeprefix("total_")


def listed(names: Iterable[str]) -> str:
    """Headers for an error text: ``'eps1 [%]', 'q'``, or `none`."""
    return ", ".join(repr(name) for name in names) or "none"
