"""Reading and writing of files: whole or not at all, and within bounds on memory and time."""
