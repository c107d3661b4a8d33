"""Entry point of `python -m msggen`."""

import sys

from msggen.cli import main

sys.exit(main())
