"""Element tests: any material cell under strain control or mixed control."""
