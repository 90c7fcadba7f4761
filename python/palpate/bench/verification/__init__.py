"""Is it right: the mechanics beside exact solutions, through the public API alone."""
