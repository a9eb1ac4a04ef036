"""What a plant can be made of besides its arm. T is N·m or N, S is rad or m, by the kind of joint."""

from dataclasses import dataclass


@dataclass(frozen=True)
class SolverFriction:
    """MuJoCo's own: ``frictionloss`` as a (slightly soft) constraint of ``level`` [T], ``viscous`` damping [T·s/S]."""

    level: float = 0.0
    viscous: float = 0.0


@dataclass(frozen=True)
class Elasticity:
    """A spring and damper between motor and link [T/S, T·s/S]; with ``gap`` [S], only outside that backlash."""

    stiffness: float
    damping: float = 0.0
    gap: float = 0.0


@dataclass(frozen=True)
class Beam:
    """Springs at a link's far end [N·m/rad] about its length and, alike, about two axes across it; none: rigid.

    ``damping`` [N·m·s/rad] is beside each spring.
    """

    torsion: float | None = None
    bending: float | None = None
    damping: float = 0.0

    @property
    def hinges(self) -> dict[int, str]:
        """MuJoCo's attributes of the hinges, by axis."""
        springs = {0: self.torsion, 1: self.bending, 2: self.bending}
        return {k: f'stiffness="{x!r}" damping="{self.damping!r}"' for k, x in springs.items() if x is not None}


@dataclass(frozen=True)
class Harness:
    """A spring across a joint [T/S], relaxed at ``rest`` [S]."""

    stiffness: float
    rest: float = 0.0


@dataclass(frozen=True)
class Stop:
    """A bumper that a joint meets from ``where`` [S] on, upwards: ``stiffness`` [T/S] times how far it is pressed."""

    stiffness: float
    where: float


@dataclass(frozen=True)
class Ripple:
    """A motor torque ``amplitude`` [T] · sin(``cycles`` [1/S] · q + ``phase``) that the drive does not know of."""

    amplitude: float
    cycles: float
    phase: float = 0.0


@dataclass(frozen=True)
class Tie:
    """What couples two joints: MuJoCo's fixed tendon of length w = q of ``first`` + ``sign`` · q of ``second``.

    Its force along w is that of a spring, ``stiffness`` [T/S] · x + ``cubic`` [T/S³] · x³ with x = w − ``rest`` [S], of
    ``viscous`` damping [T·s/S], of dry friction of ``level`` [T] and of an inertia ``armature`` [T·s²/S]. Both joints
    feel it, the second times the sign.
    """

    first: str
    second: str
    sign: float = 1.0
    stiffness: float = 0.0
    cubic: float = 0.0
    rest: float = 0.0
    viscous: float = 0.0
    level: float = 0.0
    armature: float = 0.0

    def mjcf(self, timestep: float) -> str:
        """The tendon as MJCF text; its dry friction is as stiff as `SolverFriction`."""
        return (
            f'<fixed stiffness="{self.stiffness!r} 0 {self.cubic!r}" springlength="{self.rest!r}"'
            f' damping="{self.viscous!r}" frictionloss="{self.level!r}" armature="{self.armature!r}"'
            f' solreffriction="{4 * timestep!r} 1" solimpfriction="0.99 0.99 0.001">'
            f'<joint joint="{self.first}" coef="1"/><joint joint="{self.second}" coef="{self.sign!r}"/></fixed>'
        )


@dataclass(frozen=True)
class Bumper:
    """A soft end of a joint's travel: MuJoCo's own limit, met from ``where`` [S] on upwards.

    ``stiffness`` and ``damping`` [T/S, T·s/S]; ``mobility`` is the joint's entry of the inverse mass matrix at zero
    [S/(T·s²)], by which MuJoCo scales a limit.
    """

    joint: str
    where: float
    stiffness: float
    damping: float
    mobility: float

    def mjcf(self, timestep: float) -> str:
        """A tendon over the joint alone, as MJCF text. At this impedance MuJoCo adds 2 % of mass while it touches."""
        impedance = 0.02
        spring = self.stiffness * self.mobility * (1.0 - impedance)
        damper = self.damping * self.mobility * (1.0 - impedance)
        return (
            f'<fixed limited="true" range="-1e6 {self.where!r}" solreflimit="{-spring!r} {-damper!r}"'
            f' solimplimit="{impedance} {impedance} 1"><joint joint="{self.joint}" coef="1"/></fixed>'
        )


@dataclass(frozen=True)
class Payload:
    """A point mass [kg] on the last link at ``point`` [m, link frame]."""

    mass: float
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Drift:
    """A zero that creeps: ``final`` [T] · (1 − exp(−t / ``time_constant`` [s]))."""

    final: float
    time_constant: float = 20.0


@dataclass(frozen=True)
class Disturbance:
    """Gaussian process torque of a given ``rms`` [T] in the band ``low``..``high`` [Hz]; nothing measures it."""

    rms: float
    low: float = 0.3
    high: float = 15.0


@dataclass(frozen=True)
class Servo:
    """PD control at ``bandwidth`` [Hz] on the encoder, plus the nominal arm's inverse dynamics along the motion.

    Speed is the difference of readings behind a first-order low-pass at ``speed_filter`` [Hz].
    """

    bandwidth: float = 4.0
    damping_ratio: float = 0.8
    speed_filter: float = 60.0
