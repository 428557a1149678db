"""Tests of a soil laboratory: read from a user's files, checked, turned into records."""

from granbench.laboratory.conversion import to_records
from granbench.laboratory.formats import read_selected, read_tests
from granbench.laboratory.laboratory_test import LaboratoryTest
from granbench.laboratory.settings import ImportSettings

__all__ = ["ImportSettings", "LaboratoryTest", "read_selected", "read_tests", "to_records"]
