"""Parameters from recordings, and the name of the physics that the model leaves out."""
