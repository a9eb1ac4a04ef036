"""Every number that decides what a diagnosis says, with its unit and why it has the value it has.

A test moves each one by a factor of two and sees an answer change (``tests/identification/test_deciding_*.py``).
Tolerances of solvers stay beside their solver, and what only words or pictures depend on beside those.
"""

# Prior odds, before the recordings are looked at. Shared by the vocabulary's effects, and by the places of each.
ODDS_OF_NAMES = 0.5
"""Prior odds that one of the named effects is missing."""
ELSEWHERE = 0.5
"""Prior probability that an effect acts at several places and not at a single one: joints are built alike."""
ODDS_OF_CURVES = 0.2
"""Prior odds that something nameless is missing."""

# Prior sizes.
SIZES = (0.003, 0.01, 0.03, 0.1, 0.3)
"""Sizes of an effect over which the evidence is averaged [share of the channel's RMS torque]."""
WHOLE = 0.12
"""Standard deviation about one of the size of a law without amplitudes: its shape may lie between grid points."""
SLOPE = 0.3
"""Standard deviation of a shape between grid points [steps of the grid]."""
BENDS = (0.15, 0.4)
"""What a curve over a law's own coordinate may add to the law, since no law is exact [share of the law]; averaged."""
DISCREPANCY = 0.001
"""Size of curves beside every explanation [share of the channel's RMS torque] (Kennedy and O'Hagan 2001)."""
LAW_ERROR = 0.02
"""Size of a curve over the coordinate of each law of the model [share of the law's torque]."""
BASELINE = 0.2
"""How far the baseline may move beside an explanation [share of the channel's RMS torque] ..."""
BASELINE_OWN = 0.5
"""... beyond this share of each parameter's own value; linear laws."""
BASELINE_SHAPE = 0.3
"""How far a parameter may move in which the torque is nonlinear [share of its value]: as far as its slope holds."""
TOLERANCES = (0.001, 0.003, 0.01, 0.03)
"""Tolerances that a model's masses may have [share]; the evidence chooses one."""
ROUNDS = 4
"""Most searches for what is missing, each after a joint fit of what was found."""
SECOND_CHOICES = 2
"""Most searches for another explanation in place of a name that the held-out recordings did not confirm."""

# Noise.
WANDER_TIMES = (2.0, 8.0, 40.0)
"""Correlation times of a torque that wanders [s]."""
WANDER_PRIOR = 5.0
"""Rate of the exponential prior of a wander's level [1 / RMS of the residual] (Simpson et al. 2017)."""
DRIVEN = 0.01
"""Largest share of a joint's jerk that unexplained torque may have driven inside the instrument motion's band."""

# Vibration.
VIBRATION_PACES = (0.15, 0.3, 0.45, 0.6, 0.8)
"""Speeds about which a joint may vibrate [share of its peak speed] ..."""
VIBRATION_WIDTHS = (0.15, 0.3)
"""... and how far about them [standard deviation, share of the peak speed]."""
VIBRATION_SLOWEST = 1.0
"""Lowest frequency [Hz]: what is slower is a joint's own motion."""
VIBRATION_RESOLVED = 0.35
"""Highest frequency [1 / period of the samples]."""
VIBRATION_DAMPING = 0.05
"""Largest damping ratio: structures have 0.5 to 5 %, and what dies faster is no vibration."""

# Sticking.
STICKS = ((0.04, 0.005), (0.01, 0.001))
"""Below this share of the peak speed, or so shortly after it (share of the travel), a joint holds any torque; the
evidence chooses one."""
SETTLES = (0.10, 0.012)
"""Below this share of the peak speed, or so shortly after it (share of the travel), friction still settles."""
LEAST_LEVEL = 0.03
"""Least torque level up to which a joint may stick [share of the channel's RMS torque]."""

# Bursts.
BURST_WINDOW = 0.5
"""Length of the windows of the residual whose strengths are compared [s]."""
BURST_LOUD = 3.0
"""Mean square from which on a window counts as loud [times the median window's]."""
BURST_SHARE = 0.2
"""Share of the residual's energy in loud windows from which on they are bursts."""

# The answer.
GATE = 2.0
"""What a name must gain on the held-out recordings [standard errors over blocks of time]."""
CLASS = 0.1
"""Posterior share from which on a rival in a name's place is not separable from the name."""
ALIKE = 0.98
"""Cosine between what two explanations add from which on they are not separable."""
NEARLY = 0.75
"""Share of what a nameless curve adds that a law must be able to add to be named in the curve's place."""
BLOCK = 1.5
"""Shortest block of time [s]: longer than the residual's correlation."""
