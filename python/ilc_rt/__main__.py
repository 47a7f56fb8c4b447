"""``python -m ilc_rt`` is ``ilc``."""

import sys

from ilc_rt.cli import main

if __name__ == "__main__":
    sys.exit(main())
