"""Units of stress and strain, numbers with units, and the range of plausible values."""
