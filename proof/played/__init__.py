"""Third generator of proof cases: robots as published, moved on paper, with what real machines left unexplained."""
