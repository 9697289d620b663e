"""``python -m oasisview``."""

from __future__ import annotations

import sys

from oasisview.cli import main

if __name__ == "__main__":
    sys.exit(main())
