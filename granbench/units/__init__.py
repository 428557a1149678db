"""Units of stress and strain, numbers written with units, and the range of plausible values."""
