"""What every generator that runs a classical model says of it."""

from pydantic import BaseModel, ConfigDict

from granbench.models import find_model
from granbench.models.classical import ClassicalCell


class ModelTruth(BaseModel):
    """The model behind a dataset.

    Parameters
    ----------
    dataset : name
    model : in the catalogue of classical models
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    dataset: str
    model: str

    def cell(self) -> ClassicalCell:
        """The ground truth itself, with the default parameters of the model.

        Raises
        ------
        ModelError
            If the catalogue does not have the model.
        """
        return find_model(self.model)()
