"""Limits beyond which a number from a user must be in a wrong unit."""

LARGEST_STRESS = 1e9
"""Pa; 1 GPa is beyond the reach of soil laboratories, and crushes all grains."""

SMALLEST_STRESS = 1e3
"""Pa; a test with all stresses below 1 kPa has been read in the wrong unit."""

SMALLEST_BARE_PRESSURE = 1e4
"""Pa; a smaller number without a unit may be in kPa."""

LARGEST_STRAIN = 1.0
"""A strain of larger magnitude must be in per cent."""

VOID_RATIOS = (0.05, 10.0)
"""Smallest and largest void ratio: below is rock, above a slurry, or a number in per cent."""

LARGEST_OVERCONSOLIDATION = 1e4
"""A soil at 100 kPa that was once under 1 GPa."""

LARGEST_SEED = 2**63 - 1
"""Largest seed that files and random generators accept."""
