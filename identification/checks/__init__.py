"""Whether recordings and a model can belong together: readings of the data that compete, and the findings."""
