"""Loading programmes: what is prescribed along a path, without any material or engine."""

from granbench.paths.cyclic import CyclicTriaxial
from granbench.paths.programme import LoadingProgramme
from granbench.paths.random_strain import RandomStrain
from granbench.paths.triaxial import ConstantMeanStress, ConstantMinorStress

__all__ = [
    "ConstantMeanStress",
    "ConstantMinorStress",
    "CyclicTriaxial",
    "LoadingProgramme",
    "RandomStrain",
]
