"""`python -m positioner` is `positioner`."""

import sys

from positioner.cli.main import main

sys.exit(main())
