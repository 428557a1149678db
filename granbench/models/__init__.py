"""Classical constitutive models as material cells, one model one file."""

from granbench.models.catalogue import MODELS, find_model
from granbench.models.classical import ClassicalCell
from granbench.models.parameters import Parameter

__all__ = ["MODELS", "ClassicalCell", "Parameter", "find_model"]
