"""Whether recordings and a model can belong together: competing readings of the data, and the findings."""
