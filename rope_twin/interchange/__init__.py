"""Exchange of models with other programs: MoorDyn decks, OrcaFlex text files."""
