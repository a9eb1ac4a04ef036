"""Find where a space manipulator's simulation and its recordings disagree, and name the missing physics."""

__version__ = "0.1.0"
