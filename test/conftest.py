"""Property tests: the same examples in every run; `--hypothesis-profile=search` tries new ones."""

from __future__ import annotations

from hypothesis import Phase, settings

# A counterexample is printed as found: shrinking it takes minutes where an example is a simulation.
PHASES = (Phase.explicit, Phase.reuse, Phase.generate)
settings.register_profile("repeated", derandomize=True, database=None, deadline=None, phases=PHASES)
settings.register_profile("search", deadline=None, print_blob=True)
settings.load_profile("repeated")
