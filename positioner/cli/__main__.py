"""`python -m positioner.cli` is `positioner`."""

import sys

from positioner.cli.main import main

sys.exit(main())
