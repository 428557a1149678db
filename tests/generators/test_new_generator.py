"""How to add a generator: one folder and one entry point, here in a package from outside.

`GENERATOR` is the whole code of a family, `toy`, with one dataset. `ENTRY_POINT` is the line that
registers it. Inside GranBench the code goes to a folder of `generators/` and the line to
`pyproject.toml`; nothing else changes.
"""

import json
from pathlib import Path

import pytest
from plug_in import granbench, install, refused

GENERATOR = '''
"""Random strain paths through a linear spring."""

import numpy as np
from pydantic import BaseModel

from granbench.generators.assembly import Assembled, read_arrays
from granbench.generators.campaign import Job
from granbench.generators.generator import Generator


class Preset(BaseModel):
    name: str
    version: str
    paths: int
    steps: int


DATASETS = {"toy": 2e7}  # one more dataset is one more entry: here its modulus, Pa
PRESETS = {"smoke": Preset(name="smoke", version="0.0.0+smoke", paths=4, steps=10)}


def jobs(modulus, preset, seed):
    """One job for each split: a pure function of its configuration and seed."""
    configuration = {"modulus": modulus, "paths": preset.paths, "steps": preset.steps}
    return [
        Job(split, "granbench_toy.generator:load", configuration, seed + number)
        for number, split in enumerate(("train", "test"))
    ]


def load(configuration, seed, inputs, out):
    """Write the records of one split to the folder `out`, under the names of the schema."""
    rng = np.random.default_rng(seed)
    strain = rng.normal(0.0, 1e-3, (configuration["paths"], configuration["steps"] + 1, 3))
    strain[:, 0] = 0.0
    stress = configuration["modulus"] * strain
    np.savez(out / "record.npz", strain=strain, stress=stress)


def assemble(modulus, preset, seed, results):
    """Put the results of the jobs together; common attributes are added to them."""
    records = [read_arrays(folder / "record.npz") for folder in results.values()]
    splits = np.repeat(list(results), preset.paths)
    names = [f"{split}/{number}" for number, split in enumerate(splits)]
    return Assembled(
        order="principal",
        series={name: np.concatenate([r[name] for r in records]) for name in records[0]},
        paths={
            "path_id": names,
            "specimen": names,
            "split": splits,
            "loading_family": ["random"] * len(names),
            "seed": np.full(len(names), seed),
        },
        title="Random strain paths through a linear spring",
        engine="granbench_toy",
        engine_version="1.0",
        thesis_section="none",
        configuration={"modulus": modulus},
    )


GENERATOR = Generator(datasets=DATASETS, presets=PRESETS, jobs=jobs, assemble=assemble)
'''
ENTRY_POINT = "toy = granbench_toy.generator:GENERATOR"


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A folder of installed packages with the package `granbench_toy`."""
    site = tmp_path / "site"
    files = {"granbench_toy/__init__.py": "", "granbench_toy/generator.py": GENERATOR}
    install(site, files, "granbench.generators", ENTRY_POINT)
    return site


def test_a_new_generator_makes_its_dataset_and_continues_a_campaign(site, tmp_path):
    command = ("generate", "toy", "--preset", "smoke", "--json", "--out")
    first = json.loads(granbench(site, *command, tmp_path / "first"))
    file = Path(first["dataset"])
    assert file == tmp_path / "first" / "toy-0.0.0+smoke.nc"
    granbench(site, "data", "verify", file)

    content = file.read_bytes()
    file.unlink()
    lost = tmp_path / "first" / "campaign" / "results" / "train" / "record.npz"
    lost.unlink()
    again = json.loads(granbench(site, *command, tmp_path / "first"))
    assert (again["done"], again["continued"]) == (2, 1)
    assert file.read_bytes() == content

    other = json.loads(granbench(site, *command, tmp_path / "other", "--seed", 5))
    assert Path(other["dataset"]).read_bytes() != content


def test_a_generator_that_cannot_be_imported_is_named_and_disturbs_no_other(site, tmp_path):
    (site / "granbench_toy" / "generator.py").write_text("import no_such_module\n")
    broken = refused(site, "generate", "toy", "--out", tmp_path / "out")
    assert "granbench_toy.generator" in broken and "no_such_module" in broken
    unknown = refused(site, "generate", "gp-j9", "--out", tmp_path / "out")
    assert "gp-j2" in unknown and "toy" not in unknown
