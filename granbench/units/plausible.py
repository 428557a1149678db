"""Sizes beyond which a number that a user gives is explained by a wrong unit alone."""

LARGEST_STRESS = 1e9
"""Pa; 1 GPa is beyond what soil laboratories reach, and crushes any grain."""

SMALLEST_STRESS = 1e3
"""Pa; a test whose stresses all lie below 1 kPa is read in the wrong unit."""

SMALLEST_BARE_PRESSURE = 1e4
"""Pa; a smaller number that is given without a unit may well be one of kPa."""

LARGEST_STRAIN = 1.0
"""A strain beyond it, in either sense, is a number of per cent."""

VOID_RATIOS = (0.05, 10.0)
"""Least and greatest: below is rock, above a slurry, or a number of per cent."""

LARGEST_OVERCONSOLIDATION = 1e4
"""100 kPa under a soil that was under 1 GPa."""

LARGEST_SEED = 2**63 - 1
"""What files can hold, and every random generator takes."""
