"""Command delay: the recorded torque is what the controller asks for; the drive delivers it a moment later.

So the recorded torque is ahead of the motion: it is what the motion needs a delay later. The controller's cycle, the
fieldbus and the current loop add up to the delay.

What looks alike, and what tells it apart:

- A late encoder (`sensor_delay` at the joint's position). Of one joint alone it makes the very same torque; of several,
  it moves the other joints' torque as well. A torque sensor, or the motor's measured current, shows a late drive by
  itself: a pulse of the command comes a delay later. It knows nothing of a late encoder.
- Viscous friction and rotor inertia. To first order a lead adds delay * d torque / dt. At one frequency that of an
  inertial torque is negative viscous friction, that of a spring's or gravity's positive, that of viscous friction is
  rotor inertia. Pulses have many frequencies, and the three part.
"""

from ..effect import Effect
from . import _delay

EFFECT = Effect(
    name="command_delay",
    family="drive train",
    at="sensor",
    sentence="a drive that delivers the recorded torque, a command, a constant time later",
    equation=f"delivered = command(time - delay), as {_delay.EQUATION}",
    source="Padé (1892); Nilsson (1998)",
    parameters=(_delay.delay("time by which the drive delivers the command late"),),
    law=_delay.law,
    states=_delay.STATES,
    rate=_delay.rate,
    leads=True,
    experiment="give {at} short pulses of command, and measure when a torque sensor, the motor's own current or an "
    "accelerometer on the link answers: a late drive answers late, behind a late encoder it does not",
)
