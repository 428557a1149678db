"""The kinds of input: for each the valid files, how one is changed, and how it is read."""

import json
import random
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from laboratory.laboratory_files import drained_curve, write_csv, write_karlsruhe, write_protocol
from mutators import mutate_bytes, mutate_json, mutate_netcdf, mutate_table, mutate_zip
from plane_records import plane_records
from small_cells import secant
from small_submissions import submitted
from synthetic_records import synthetic_records

from granbench.records import open_records, write_records


@dataclass(frozen=True)
class Kind:
    """One kind of input.

    Parameters
    ----------
    seeds : writes the valid inputs, each a folder of its own, into a folder
    change : changes the input in a folder
    read : reads the input in a folder as GranBench does, and raises its errors
    """

    seeds: Callable[[Path], None]
    change: Callable[[Path, random.Random], None]
    read: Callable[[Path], object]


def _only_file(folder: Path) -> Path:
    return min(folder.iterdir())


def _change_netcdf(path: Path, rng: random.Random) -> None:
    if rng.random() < 0.7:
        mutate_netcdf(path, rng)
    else:
        path.write_bytes(mutate_bytes(path.read_bytes(), rng))


# Datasets


def _dataset_seeds(folder: Path) -> None:
    write_records(synthetic_records(n_specimens=5, steps=5), _in(folder, "particles/a.nc"))
    write_records(plane_records(), _in(folder, "plane/a.nc"))
    synthetic_records(n_specimens=5, steps=5).to_netcdf(_in(folder, "unsealed/a.nc"))


def _read_dataset(folder: Path) -> None:
    from granbench.data.summary import listed_paths, summarise_file
    from granbench.data.verification import read_as_trusted, verify_file
    from granbench.models.ground_truth import ground_truth_cell

    file = _only_file(folder)
    with open_records(file) as ds:
        ground_truth_cell(ds)
        ds.load()
    read_as_trusted(file, listed_paths)
    read_as_trusted(file, summarise_file)
    if folder.name != "unsealed":
        verify_file(file)


# Tasks


def _task_seeds(folder: Path) -> None:
    from granbench.benchmark.task_registry import TASK_FOLDER

    for name in ("gp-j2", "fem-ime", "dem-triaxial"):
        shutil.copyfile(TASK_FOLDER / f"{name}-1.0.0.yaml", _in(folder, f"{name}/task.yaml"))


def _read_task(folder: Path) -> None:
    from granbench.benchmark.task_registry import read_task

    read_task(_only_file(folder))


# Predictions and submissions


def _submission_seeds(folder: Path) -> None:
    for name, made, axes in (
        ("particles", synthetic_records(n_specimens=8, steps=12), ("rollout", "physics", "cost")),
        ("plane", plane_records(), ("rollout", "single-step")),
    ):
        records = _in(folder, f"{name}/records.nc")
        write_records(made, records)
        if name == "particles":
            with open_records(records) as sealed:
                submitted(secant(), sealed.load(), folder / name / "s.json", axes=_known(axes))
        else:
            _model_submission(records, folder / name / "s.json")


def _known(wanted: tuple[str, ...]) -> tuple[str, ...]:
    from granbench.benchmark.registry import axis_names

    return tuple(axis for axis in axis_names() if axis in wanted) or axis_names()


def _model_submission(records: Path, out: Path) -> None:
    """A submission of a classical model, which validation runs again."""
    from small_submissions import about

    from granbench.benchmark.evaluation import predict
    from granbench.benchmark.predictions import evaluated
    from granbench.benchmark.registry import axis_names
    from granbench.cells.find import find_cells
    from granbench.leaderboard.composition import compose

    with open_records(records) as sealed:
        candidate = find_cells("j2", sealed.load(), seeds=(0,))
        predictions = predict(candidate.cells, evaluated(sealed), axis_names()[:1])
        compose(predictions, sealed, about("j2"), out)


def _change_submission(folder: Path, rng: random.Random) -> None:
    file = folder / "s.json"
    file.write_text(mutate_json(file.read_text(), rng))


def _change_predictions(folder: Path, rng: random.Random) -> None:
    """The file of predictions, with the digest that the submission should then have."""
    from granbench.leaderboard.submission import file_digest

    _change_netcdf(folder / "s.nc", rng)
    content = json.loads((folder / "s.json").read_text())
    content["predictions"] |= {
        "sha256": file_digest(folder / "s.nc"),
        "bytes": max(1, (folder / "s.nc").stat().st_size),
    }
    (folder / "s.json").write_text(json.dumps(content))


def _read_submission(folder: Path) -> None:
    from granbench.leaderboard.validation import validate

    validate(folder / "s.json", _sealed(folder))


_SEALED: dict[int, xr.Dataset] = {}


def _sealed(folder: Path) -> xr.Dataset:
    file = folder / "records.nc"
    key = file.stat().st_size
    if key not in _SEALED:
        with open_records(file) as ds:
            _SEALED[key] = ds.load()
    return _SEALED[key]


# Trained models and parameter files


def _model_seeds(folder: Path) -> None:
    import torch

    from granbench.baselines.gru import GruConfiguration, GruNetwork
    from granbench.baselines.recurrent_network import RecurrentConfiguration, RecurrentNetwork
    from granbench.baselines.training.model_files import ModelDescription, write_model
    from granbench.models import find_model
    from granbench.models.parameter_file import write_parameters

    torch.manual_seed(0)
    gru = GruConfiguration(hidden=4)
    mlstm = RecurrentConfiguration(initial_layer=True, hidden=4)
    fitted = find_model("j2")()
    weights = {name: torch.tensor(value).double() for name, value in fitted.values().items()}
    for name, configuration, tensors, records in (
        ("gru", gru.as_dict(), GruNetwork(gru).state_dict(), plane_records()),
        (
            "mlstm",
            mlstm.as_dict(),
            RecurrentNetwork(mlstm).state_dict(),
            synthetic_records(n_specimens=5, steps=5),
        ),
        ("j2-fitted", {"model": "j2"}, weights, plane_records()),
    ):
        _in(folder, f"{name}/model/x").parent.mkdir(exist_ok=True)
        description = ModelDescription(name, configuration, 1, {"seed": 0, "dataset": "a"})
        write_model(folder / name / "model", tensors, description)
        write_records(records, folder / name / "records.nc")
    _in(folder, "parameters/model/x")
    write_parameters(fitted, folder / "parameters/model/parameters.json", {"from": "a test"})
    write_records(plane_records(), folder / "parameters/records.nc")


def _change_model(folder: Path, rng: random.Random) -> None:
    """One of the files, with the digest of the weights that the description should then have."""
    from granbench.leaderboard.submission import file_digest

    file = rng.choice(sorted((folder / "model").iterdir()))
    if file.suffix == ".json":
        file.write_text(mutate_json(file.read_text(), rng))
        return
    content = file.read_bytes()
    length = int.from_bytes(content[:8], "little")
    if rng.random() < 0.6:
        header = mutate_json(content[8 : 8 + length].decode(), rng).encode()
        content = len(header).to_bytes(8, "little") + header + content[8 + length :]
    else:
        content = mutate_bytes(content, rng)
    file.write_bytes(content)
    description = json.loads((folder / "model/model.json").read_text())
    description["weights_sha256"] = file_digest(file)
    (folder / "model/model.json").write_text(json.dumps(description))


def _read_model(folder: Path) -> None:
    from granbench.cells.find import find_cells

    parameters = folder / "model/parameters.json"
    model = parameters if parameters.exists() else folder / "model"
    candidate = find_cells(str(model), _sealed(folder), seeds=(0,))
    _ = candidate.parameters


# Laboratory files, paths, load paths, meshes


def _laboratory_seeds(folder: Path) -> None:
    curve = drained_curve(rows=12)
    columns = [curve["eps1"], curve["epsv"], curve["q"], curve["p"]]
    write_csv(_in(folder, "csv/a.csv"), ["eps1 [%]", "epsv [%]", "q [kPa]", "p [kPa]"], columns)
    write_karlsruhe(_in(folder, "karlsruhe/a.dat"), curve)
    write_protocol(_in(folder, "protocol/a.xlsx"), curve)
    axial, dilation, q = curve["eps1"] / 100.0, -curve["epsv"] / 100.0, curve["q"] + 1.0
    np.savez(
        _in(folder, "soilmodels/data_CID.npz"),
        a0=np.stack([dilation, axial - dilation / 3.0], axis=-1)[:, None],
        a1=np.stack([300.0 + q, q], axis=-1)[:, None],
        a2=2650.0 / 1.8 * (1.0 + dilation)[:, None, None],
    )
    ratio = 0.4 - 0.1 * axial
    series = [0.0 * axial, 0.0 * axial, axial, ratio, 5.0 + 100.0 * axial, 2.0 + 50.0 * axial]
    np.savez(
        _in(folder, "grainlearning/a.npz"),
        data=np.stack(series)[None],
        keys=np.array(["e_x", "e_y", "e_z", "n", "p", "q"]),
        params=np.zeros((1, 4)),
    )


def _change_file(folder: Path, rng: random.Random) -> None:
    file = _only_file(folder)
    content = file.read_bytes()
    if rng.random() < 0.3:
        file.write_bytes(mutate_bytes(content, rng))
    elif zipfile.is_zipfile(file):
        file.write_bytes(mutate_zip(content, rng))
    else:
        file.write_text(mutate_table(content.decode(), rng), encoding="utf-8", newline="")


def _read_laboratory(folder: Path) -> None:
    from granbench.laboratory.formats import read_tests

    read_tests(_only_file(folder))


def _path_seeds(folder: Path) -> None:
    rows = "\n".join(f"{0.001 * k},{-0.0004 * k},{0.0001 * k}" for k in range(20))
    _in(folder, "plane/a.csv").write_text(f"eps_xx,eps_yy,eps_xy\n{rows}\n")
    rows = "\n".join(f"{0.001 * k};{1e5 + k};{1e5}" for k in range(20))
    _in(folder, "mixed/a.csv").write_text(f"eps_11;sig_22;sig_33\n{rows}\n")


def _read_path(folder: Path) -> None:
    from granbench.paths.strain_files import read_path

    read_path(_only_file(folder))


def _load_path_seeds(folder: Path) -> None:
    _in(folder, "up/a.csv").write_text("time,displacement\n0,0\n0.04,0.004\n0.07,0.005\n")
    _in(folder, "cycle/a.csv").write_text("time,displacement\n0,0\n0.04,0.004\n0.05,0.003\n")


def _read_load_path(folder: Path) -> None:
    from granbench.fem.load_path_file import read_load_path

    read_load_path(_only_file(folder))


def _mesh_seeds(folder: Path) -> None:
    import meshio

    points = np.array([[x, y, 0.0] for y in range(3) for x in range(3)], dtype=float)
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    lines = np.array([[0, 1], [1, 2]])
    tags = [np.ones(4, dtype=int), np.full(2, 2)]
    mesh = meshio.Mesh(
        points,
        [("quad", quads), ("line", lines)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"body": np.array([1, 2]), "bottom": np.array([2, 1])},
    )
    mesh.write(_in(folder, "gmsh/a.msh"), file_format="gmsh22", binary=False)
    meshio.Mesh(points, [("quad", quads)]).write(_in(folder, "vtk/a.vtu"), binary=False)
    nodes = "\n".join(f"{k + 1}, {x}, {y}" for k, (x, y, _) in enumerate(points))
    cells = "\n".join(f"{k + 1}, {', '.join(map(str, quad + 1))}" for k, quad in enumerate(quads))
    _in(folder, "abaqus/a.inp").write_text(
        f"*NODE\n{nodes}\n*ELEMENT, TYPE=CPS4\n{cells}\n*ELEMENT, TYPE=T2D2, ELSET=bottom\n"
        "5, 1, 2\n6, 2, 3\n"
    )


def _read_mesh(folder: Path) -> None:
    from granbench.fem.mesh_file import read_mesh

    read_mesh(_only_file(folder))


def _in(folder: Path, name: str) -> Path:
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    return folder / name


def _change_dataset(folder: Path, rng: random.Random) -> None:
    _change_netcdf(_only_file(folder), rng)


KINDS: dict[str, Kind] = {
    "dataset": Kind(_dataset_seeds, _change_dataset, _read_dataset),
    "task": Kind(_task_seeds, _change_file, _read_task),
    "predictions": Kind(_submission_seeds, _change_predictions, _read_submission),
    "submission": Kind(_submission_seeds, _change_submission, _read_submission),
    "model": Kind(_model_seeds, _change_model, _read_model),
    "laboratory": Kind(_laboratory_seeds, _change_file, _read_laboratory),
    "path": Kind(_path_seeds, _change_file, _read_path),
    "load-path": Kind(_load_path_seeds, _change_file, _read_load_path),
    "mesh": Kind(_mesh_seeds, _change_file, _read_mesh),
}


def make_case(kind: str, seeds: Path, case: str, folder: Path) -> Path:
    """Copy one of the valid inputs of a kind and change it.

    Parameters
    ----------
    kind : a key of `KINDS`
    seeds : folder that the kind's `seeds` wrote
    case : seeds the changes, such as ``1/dataset/17``
    folder : where the input is put
    """
    rng = random.Random(case)
    valid = [path for path in sorted(seeds.iterdir()) if path.is_dir()]
    if kind == "predictions":
        valid = [path for path in valid if (path / "s.nc").exists()]
    shutil.copytree(rng.choice(valid), folder)
    KINDS[kind].change(folder, rng)
    return folder


def described(error: BaseException) -> dict[str, Any]:
    """Type, text and place of an error for the list of failures."""
    import traceback

    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "site-packages" not in frame.filename] or frames
    last = own[-1]
    return {
        "error": type(error).__name__,
        "text": " ".join(str(error).split())[:300],
        "place": f"{Path(last.filename).name}:{last.lineno}",
    }
