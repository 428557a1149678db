"""Triaxial jobs that fail, each in a different way."""

import os
import signal

from granbench.generators.dem import recording
from granbench.generators.dem.box import GrainBox
from granbench.generators.dem.jobs import PERMANENT_FAILURES, failure_reason, shear

__all__ = [
    "PERMANENT_FAILURES",
    "failure_reason",
    "held_too_loosely",
    "killed",
    "loses_a_grain",
    "stopped_by_the_engine",
]


def killed(configuration, seed, inputs, out):
    """Kill the process of the test, as a lack of memory does."""
    os.kill(os.getpid(), signal.SIGKILL)


def held_too_loosely(configuration, seed, inputs, out):
    """Run a test with a limit of the servo error that no test can keep."""
    recording.LARGEST_SERVO_ERROR = 0.0
    shear(configuration, seed, inputs, out)


def loses_a_grain(configuration, seed, inputs, out):
    """Run a test from whose box a grain is lost, without an error of LIGGGHTS."""
    _in_the_second_chunk("group last id 400", "delete_atoms group last")
    shear(configuration, seed, inputs, out)


def stopped_by_the_engine(configuration, seed, inputs, out):
    """Run a test in which LIGGGHTS finds an error and ends the process."""
    _in_the_second_chunk("fix nothing all no/such/style")
    shear(configuration, seed, inputs, out)


def _in_the_second_chunk(*commands):
    strain, chunks = GrainBox.strain, []

    def disturbed(box, increment, steps):
        chunks.append(steps)
        if len(chunks) == 2:
            box.engine.command(*commands)
        return strain(box, increment, steps)

    GrainBox.strain = disturbed
