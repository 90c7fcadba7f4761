"""Other libraries on palpate's scenes: one file each, all behind `Contender`."""
