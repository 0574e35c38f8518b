"""Run the command line as `python -m rope_twin`."""

import sys

from rope_twin.cli import main

sys.exit(main())
