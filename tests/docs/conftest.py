"""The scripts of the folder `docs` as modules, as they find each other when they are run."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))
