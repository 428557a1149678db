"""The `fem-*` datasets, and the presets that say how large they are."""

from collections.abc import Mapping

from pydantic import BaseModel, ConfigDict

from granbench.generators.model_dataset import ModelDataset


class FemDataset(ModelDataset):
    """A dataset of finite-element analyses with one classical model.

    Parameters
    ----------
    end_strains : driving strain at the end of an analysis, by problem. CSUH softens: at twice
        these strains the corners under rough platens lose all pressure, and the explicit analysis
        fails.
    """

    end_strains: Mapping[str, float]


DATASETS: Mapping[str, FemDataset] = {
    dataset.dataset: dataset
    for dataset in (
        FemDataset(
            dataset="fem-ime",
            model="ime",
            end_strains={"biaxial": 0.1, "retaining-wall": 0.05, "strip-footing": 0.1},
        ),
        FemDataset(
            dataset="fem-csuh",
            model="csuh",
            end_strains={"biaxial": 0.05, "retaining-wall": 0.05, "strip-footing": 0.05},
        ),
    )
}


class FemPreset(BaseModel):
    """The size of a `fem-*` dataset.

    Parameters
    ----------
    name : of the preset
    version : of the dataset that is made with it
    steps : increments of a path, which are the output steps of an analysis
    points : largest number of Gauss points kept of an analysis
    uniform_points : the same for a smooth specimen, which deforms uniformly
    strain_scale : factor on the driving strains at the end
    speed : of the driven boundary, m/s
    meshes : mesh names by problem; a row of the plan picks one by its number
    embedded_outputs, embedded_points : see `EmbeddedAnalysis`
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    version: str
    steps: int
    points: int
    uniform_points: int
    strain_scale: float = 1.0
    speed: float = 0.1
    meshes: Mapping[str, tuple[str, ...]]
    embedded_outputs: int = 90
    embedded_points: int = 64


PRESETS: Mapping[str, FemPreset] = {
    preset.name: preset
    for preset in (
        FemPreset(
            name="smoke",
            version="0.0.0+smoke",
            steps=20,
            points=16,
            uniform_points=1,
            strain_scale=0.1,
            speed=0.3,
            meshes={
                "biaxial": ("coarse",),
                "retaining-wall": ("coarse",),
                "strip-footing": ("coarse",),
            },
            embedded_outputs=18,
            embedded_points=16,
        ),
        FemPreset(
            name="core",
            version="1.0.0",
            steps=180,  # the turning points of most cycles are steps
            points=96,
            uniform_points=1,
            meshes={
                "biaxial": ("medium", "coarse"),
                "retaining-wall": ("coarse",),
                "strip-footing": ("coarse",),
            },
        ),
        # The meshes of the thesis, and every Gauss point of them.
        FemPreset(
            name="paper",
            version="1.0.0+paper",
            steps=360,
            points=1000,
            uniform_points=1,
            meshes={
                "biaxial": ("table-5.2",),
                "retaining-wall": ("table-5.2",),
                "strip-footing": ("table-5.2",),
            },
        ),
    )
}
