"""The mean over a chunk, compared with the samples of a simulated LIGGGHTS average."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from granbench.generators.dem.chunk_average import ChunkAverage

intervals = st.integers(1, 7)


class RunningAverage:
    """An engine that samples as LIGGGHTS does: at multiples, and at a set-up on a multiple."""

    def __init__(self, figures, step):
        self.figures, self.step = figures, step
        self.fixes = {}

    def command(self, line):
        words = line.split()
        if words[0] == "unfix":
            del self.fixes[words[1]]
        else:
            assert words[:1] + words[2:4] == ["fix", "all", "ave/time"] and words[-1] == "running"
            assert words[1] not in self.fixes
            self.interval = int(words[4])
            self.fixes[words[1]] = []

    def run(self, steps, set_up):
        """Take every sample of a run, and return those after its first state."""
        first = self.step if set_up else self.step + 1
        taken = [s for s in range(first, self.step + steps + 1) if s % self.interval == 0]
        for samples in self.fixes.values():
            samples += [self.figures[s] for s in taken]
        self.step += steps
        return self.figures[taken]

    def fix_vector(self, name, size):
        return np.mean(self.fixes[name], axis=0)[:size]


@given(
    start=st.integers(0, 30),
    parts=st.lists(
        st.tuples(intervals, st.lists(st.integers(1, 4), min_size=1, max_size=4)),
        min_size=1,
        max_size=3,
    ),
    seed=st.integers(0, 2**16),
)
@settings(deadline=None)
@example(start=20, parts=[(5, [2, 1]), (3, [1])], seed=0)  # a set-up on a multiple, and one off it
def test_mean_of_a_chunk_is_that_of_its_samples(start, parts, seed):
    engine = RunningAverage(np.random.default_rng(seed).uniform(1, 2, (500, 2)), start)
    average = ChunkAverage(engine, "mean", ["c_a", "c_b"])
    for number, (interval, chunks) in enumerate(parts):
        if number:
            average.stop()
        average.interval = interval
        average.start(engine.step)
        for chunk, intervals_in_chunk in enumerate(chunks):
            steps = intervals_in_chunk * interval
            samples = engine.run(steps, set_up=chunk == 0)
            # Rounding of a sum of up to 49 samples between 1 and 2.
            np.testing.assert_allclose(average.of_chunk(steps), samples.mean(axis=0), rtol=1e-12)


@given(interval=intervals, steps=st.floats(0.01, 1e4))
@settings(deadline=None)
def test_whole_chunk_is_the_next_multiple_of_the_interval(interval, steps):
    average = ChunkAverage(RunningAverage(np.zeros(1), 0), "mean", ["c_a"])
    average.interval = interval
    whole = average.whole_chunk(steps)
    assert whole % interval == 0 and whole >= interval
    # A number of steps that is whole up to rounding is not increased by an interval.
    assert steps * (1 - 1e-6) - 1e-6 <= whole < steps + interval
    assert average.whole_chunk(whole * (1 + 1e-15)) == whole
