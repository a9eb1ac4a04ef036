"""Every number that decides what a diagnosis says, with its unit and why it has the value it has.

A test moves each one by a factor of two and sees an answer change (``tests/identification/test_deciding_*.py``).
Tolerances of solvers stay beside their solver, and what only words or pictures depend on beside those.
"""

# Prior odds, before the recordings are looked at. Shared by the vocabulary's effects, and by the places of each.
ODDS_OF_NAMES = 0.5
"""That one of the named effects is missing."""
ELSEWHERE = 0.5
"""That an effect which is there may be at any of its places, and not at a single one: joints are made alike."""
ODDS_OF_CURVES = 0.2
"""That something without a name is."""

# Prior sizes.
SIZES = (0.003, 0.01, 0.03, 0.1, 0.3)
"""Sizes of an effect that are averaged over [share of the channel's RMS torque]."""
WHOLE = 0.12
"""Standard deviation of the amplitude of a law without amplitudes, about one: its shape lies between grid points."""
SLOPE = 0.3
"""Standard deviation of a shape between grid points [steps of the grid]."""
BENDS = (0.15, 0.4)
"""What a curve over a law's own coordinate may add to it, for no law is exact [share of the law]; averaged over."""
DISCREPANCY = 0.001
"""Small curves beside every explanation [share of the channel's RMS torque] (Kennedy and O'Hagan 2001)."""
LAW_ERROR = 0.02
"""Small curves over what each law of the model runs over [share of the law's torque]."""
BASELINE = 0.2
"""How far the baseline may move beside an explanation [share of the channel's RMS torque] ..."""
BASELINE_OWN = 0.5
"""... beyond this share of each parameter's own value; linear laws."""
BASELINE_SHAPE = 0.3
"""How far a parameter may move that the torque is not linear in [share of its value]: as far as its slope holds."""
TOLERANCES = (0.001, 0.003, 0.01, 0.03)
"""How exactly a model's masses may be known [share]; the evidence chooses one."""
ROUNDS = 4
"""Searches of what is still missing, each after a joint fit of what was found."""
SECOND_CHOICES = 2
"""Searches for another explanation of what the held-out recordings did not confirm."""

# Noise.
WANDER_TIMES = (2.0, 8.0, 40.0)
"""Correlation times of a torque that wanders [s]."""
WANDER_PRIOR = 5.0
"""Rate of the exponential prior of its level [per RMS of the residual]: none, unless it shows (Simpson et al. 2017)."""
DRIVEN = 0.01
"""Largest share of a joint's snap inside the instrument's band that unexplained torque may have driven."""

# Sticking.
STICKS = ((0.04, 0.005), (0.01, 0.001))
"""Below this share of the peak speed, or so shortly after it (share of the travel), a joint holds any torque; the
evidence chooses one."""
SETTLES = (0.10, 0.012)
"""Below this share of the peak speed, or so shortly after it (share of the travel), friction still settles."""
LEAST_LEVEL = 0.03
"""What a joint may hold at rest at least [share of the channel's RMS torque]."""

# Bursts.
BURST_WINDOW = 0.5
"""Windows of the residual whose strengths are compared [s]."""
BURST_LOUD = 3.0
"""Times the median window's mean square from which on a window is out of the ordinary."""
BURST_SHARE = 0.2
"""Share of the residual's energy above that which makes it bursts."""

# The answer.
GATE = 1.0
"""What a name must gain on the held-out recordings [standard errors over blocks of time]."""
CLASS = 0.1
"""Posterior share from which on a rival in a name's place cannot be told from it."""
ALIKE = 0.98
"""Cosine between what two explanations add from which on they cannot be told apart."""
NEARLY = 0.75
"""Share of what a nameless curve adds that a name's law must be able to add to be named in its place."""
BLOCK = 1.5
"""Shortest block of time [s]: longer than the residual remembers."""
