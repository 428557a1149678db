"""Draw a packing of the discrete element method: packing_picture.py SPECIMEN_FOLDER PICTURE.

LIGGGHTS reads the grains from the restart file of the specimen's lowest pressure, because no other
file of the campaign contains their positions.
"""

import sys
import tempfile
from pathlib import Path

from granbench.generators.dem.box import GrainBox
from granbench.generators.dem.specimen import PreparedSpecimen
from granbench.plotting import packing_figure, save_figure


def main(folder: Path, picture: Path) -> None:
    """Draw the specimen in `folder`."""
    specimen = PreparedSpecimen.load(folder)
    state = specimen.states[0]
    with tempfile.TemporaryDirectory() as scratch:
        box = GrainBox.from_restart(
            Path(scratch) / "liggghts.log",
            folder / state.restart_file,
            specimen.diameters(),
            specimen.material,
            specimen.material.friction,
        )
        positions = box.engine.positions() - box.engine.box_low()
        figure = packing_figure(positions, 2.0 * box.radii, box.lengths)
        box.close()
    save_figure(figure, picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
