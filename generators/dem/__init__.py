"""True-triaxial tests of sphere packings by the discrete element method (LIGGGHTS)."""
