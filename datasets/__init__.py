"""The reference datasets of GranBench, which finds them by their names and checks their hashes."""
