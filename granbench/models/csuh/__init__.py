"""CSUH: the unified hardening model for clays and sands (Yao et al. 2019)."""

from granbench.models.csuh.cell import CSUH

__all__ = ["CSUH"]
