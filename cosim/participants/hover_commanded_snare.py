"""The snare of the hover case under a control program, ready made beside `HoverEndEffectorParticipant`."""

from scipy.spatial.transform import Rotation

from ...models.snare.model import Accuracy
from ...models.snare.target import Target
from ..orbit_capture import SNARE, arrival
from .hover_end_effector import MISALIGNED
from .snare_commanded import CommandedSnareParticipant


class HoverCommandedSnareParticipant(CommandedSnareParticipant):
    """`CommandedSnareParticipant` where the space arm holds it, the paper's misalignment before it.

    Parameters
    ----------
    foot : tuple of three floats
        The pin's in the end effector's frame [m].
    tilt : float
        About each axis [rad].
    """

    def __init__(
        self, foot: tuple[float, float, float] = MISALIGNED[0], tilt: float = MISALIGNED[1], name: str = "snare"
    ) -> None:
        """Describe the variables; the model is built at the first step."""
        start = arrival("hover", foot, Rotation.from_euler("xyz", [tilt] * 3))
        t = start.target
        moved = Target("moved", t.position, t.orientation, t.velocity, t.angular_velocity)
        super().__init__(SNARE, moved, Accuracy(2e-3, 10, 5e-4, SNARE.cable_radius), start.effector, name)
