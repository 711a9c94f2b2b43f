"""``python -m deli``: the command line."""

from deli.cli import main

if __name__ == "__main__":
    main()
