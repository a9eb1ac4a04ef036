"""Which effect, where: candidates, whitened evidence, forward search, and what tells the remaining rivals apart."""
