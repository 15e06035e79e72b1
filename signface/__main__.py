"""`python -m signface`: the command `signface`."""

import sys

from signface.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
