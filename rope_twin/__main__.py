"""`python -m rope_twin`: the same as `rope_twin`."""

import sys

from rope_twin.cli import main

sys.exit(main())
