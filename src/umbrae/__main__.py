"""`python -m umbrae` is the same as `umbrae`."""

from umbrae.cli import main

if __name__ == "__main__":
    main()
