"""``python -m granbench`` is the command ``granbench``."""

from granbench.cli import main

if __name__ == "__main__":
    main()
