"""`python -m studies` is the same as `wanderlast`."""

import sys

from studies.commands.cli import main

if __name__ == "__main__":
    sys.exit(main())
