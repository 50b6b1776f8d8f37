"""`python -m ddf` is the command `ddf`."""

import sys

from ddf.cli import main

if __name__ == "__main__":
    sys.exit(main())
