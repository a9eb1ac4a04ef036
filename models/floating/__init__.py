"""Arms on a fixed or floating base: equations of motion, built-in arms, and their simulation."""
