"""Sizes beyond which a number that a user gives is explained by a wrong unit alone."""

LARGEST_STRESS = 1e9
"""Pa; 1 GPa is beyond what soil laboratories reach, and crushes any grain."""

SMALLEST_STRESS = 1e3
"""Pa; a test whose stresses all lie below 1 kPa is read in the wrong unit."""

LARGEST_STRAIN = 1.0
"""A strain beyond it, in either sense, is a number of per cent."""

VOID_RATIOS = (0.05, 10.0)
"""Least and greatest: below is rock, above a slurry, or a number of per cent."""
