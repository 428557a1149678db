"""GranBench: the open benchmark of data-driven geomechanics.

Data walks one way: paths -> cell -> records -> protocols -> scoring -> submission -> board.
"""

from importlib.metadata import version

__version__ = version("granbench")
