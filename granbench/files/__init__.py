"""Reading of files within bounds on memory and time, and writing of complete files."""
