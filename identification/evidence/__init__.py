"""One evidence for every explanation of a residual: linear, Gaussian, with every nuisance beside it."""
