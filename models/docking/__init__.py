"""The rigid half of an end effector: carriage, three balls in V-grooves, and latches."""
