"""The description of a dataset that a classical model makes."""

from pydantic import BaseModel, ConfigDict

from granbench.models import find_model
from granbench.models.classical import ClassicalCell


class ModelDataset(BaseModel):
    """A dataset whose stresses are those of a classical model.

    Parameters
    ----------
    dataset : name of the dataset
    model : name of the model in the catalogue of classical models
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    dataset: str
    model: str

    def cell(self) -> ClassicalCell:
        """The model with its default parameters.

        Raises
        ------
        ModelError
            If the catalogue does not have the model.
        """
        return find_model(self.model)()
