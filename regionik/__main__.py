"""``python -m regionik`` is the command ``regionik``."""

from regionik.cli import main

if __name__ == "__main__":
    main()
