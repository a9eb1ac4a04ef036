"""MuJoCo's system identification toolbox, as an engineer would reach for it: damping, frictionloss, armature, masses.

``mujoco.sysid`` fits parameters of a MuJoCo model by box-constrained least squares. Here every joint's ``damping``,
``frictionloss`` and ``armature`` are free, and every link's mass, with which its inertia goes. Its default residual
simulates forward from the first sample, which no arm without its servo bears for 20 s; so the torque along the recorded
motion (``mj_inverse``, friction and rotor included) is compared, conditioned as for the other rivals.

MuJoCo's friction is a soft constraint: it turns round where ``qdd + b qd`` does, with ``b = 2 / (0.95 t)`` and a time
constant ``t``. At the default of 0.02 s that is far from Coulomb's law on a slow joint; `SOFT` is tried from there on,
and the one that leaves least of the fitted recording is kept.

The method names nothing by itself. It is taken to blame a mass, and a rotor, wherever its own 95 % interval does not
hold what the URDF says; friction, where the model has none and it finds some.
"""

import os
from collections.abc import Collection, Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

# pyright: reportAttributeAccessIssue=false
# (pyright does not see the names that mujoco takes from its compiled module)
import mujoco
import numpy as np
from mujoco import sysid
from numpy.typing import NDArray
from scipy.special import erf

from .rival_columns import Recording, low_pass

NAME = "mujoco_sysid"
MASSES = np.array([0.2, 5.0])
"""Bounds of a mass, times the URDF's."""
MOST, CLOSE = 20, 1e-4
"""Most iterations of Gauss and Newton, and the relative step at which they end."""
SOFT = (0.02, 0.002, 0.0002)
"""Time constants of the friction constraint [s]; MuJoCo wants two time steps at least, so the step follows."""
FAST = 100.0
"""Torque is computed at this rate at least [Hz]: five times what the band asks for."""


class Parameter(NamedTuple):
    """What was freed: its kind, its joint's number, what the URDF says [SI], what was found, half its 95 % interval."""

    kind: str
    joint: int
    stated: float
    found: float
    half: float

    @property
    def moved(self) -> bool:
        """Whether the method says that it is not what the URDF says."""
        return abs(self.found - self.stated) > self.half

    @property
    def sure(self) -> float:
        """Probability of a normal deviate smaller than the move."""
        return float(erf(1.96 * abs(self.found - self.stated) / self.half / np.sqrt(2.0))) if self.half > 0 else 1.0


class Fitted:
    """The toolbox's fit of an arm to one recording.

    Parameters
    ----------
    urdf : Path
        Of the arm, without meshes.
    r : Recording
        What is fitted.
    scale : array of shape (J,)
        What each channel's residual is divided by [N·m].
    soft : float
        Time constant of the friction constraint [s].
    """

    def __init__(self, urdf: Path, r: Recording, scale: NDArray, soft: float) -> None:
        """Fit, from the URDF's masses and a little friction and rotor."""
        self.joints, self.links = r.model.joints, [link.name for link in r.model.tree.links]
        self.spec = mujoco.MjSpec.from_file(os.fspath(urdf))
        self.spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
        self.soft, self.spec.option.timestep = soft, 0.5 * soft
        for joint in self.joints:
            self.spec.joint(joint).solref_friction = [soft, 1.0]
            self.spec.add_sensor(name=f"tau.{joint}", type=mujoco.mjtSensor.mjSENS_USER, dim=1)
        start = self._start(r)
        times, asked = r.time[:: r.stride], [(f"tau.{j}", 1, sysid.SignalType.CustomObs) for j in self.joints]
        seen = sysid.TimeSeries.from_custom_map(times, r.tau, asked)
        still = sysid.TimeSeries(times, np.zeros((len(times), 0)))
        model = self.spec.compile()
        data = mujoco.MjData(model)
        first = sysid.create_initial_state(model, data.qpos, data.qvel, data.act)

        def along(models: Sequence[Any], **_: Any) -> list[Any]:
            """The torque that each model needs along the recorded motion, in place of a simulation."""
            found = []
            for one in models:
                torque = sysid.TimeSeries.from_custom_map(times, self.torque(one, r), asked)
                state = sysid.TimeSeries(times, times[:, None])
                found.append(sysid.SystemTrajectory(one, still, torque, first, state))
            return found

        def weighted(params: Any, told: Any, measured: Any, *_: Any, **__: Any) -> tuple[NDArray, Any, Any]:
            return (told.data - measured.data) / scale, told, measured

        residual = sysid.build_residual_fn(
            models_sequences=[sysid.ModelSequences("arm", self.spec, "fit", first, still, seen, True)],
            modify_residual=weighted,
            custom_rollout=along,
            resample_true=False,
            n_threads=1,
        )
        # It prints its steps unless it is told not to, by an argument whose name `optimize` has for itself, too.
        with redirect_stdout(StringIO()):
            params, result = sysid.optimize(start, residual, verbose=False, max_iters=MOST, xtol=CLOSE, x_scale="jac")
        left, _, _ = residual(result.x, params)
        self.left = float(np.sum(np.square(np.concatenate([np.ravel(x) for x in left]))))
        half = sysid.calculate_intervals([np.ravel(x) for x in left], result.jac)[1]
        self.model = sysid.apply_param_modifiers(params, self.spec)
        stated = np.concatenate([np.zeros(3 * len(self.joints)), start.as_vector()[3 * len(self.joints) :]])
        kinds = [(kind, k) for kind in ("damping", "frictionloss", "armature", "mass") for k in range(len(self.joints))]
        rows = zip(kinds, stated, result.x, half, strict=True)
        self.parameters = [Parameter(*key, float(s), float(x), float(h)) for key, s, x, h in rows]

    def _start(self, r: Recording) -> Any:
        """Parameters with their bounds: friction up to all of a joint's torque, rotors up to ten times its inertia."""
        found = sysid.ParameterDict()
        size, speed, calm = (np.sqrt(np.mean(x**2, axis=0)) for x in (r.load, r.qd, r.qdd))
        size = np.maximum(size, 1e-3 * size.max())
        for kind, top in (("damping", size / speed), ("frictionloss", size), ("armature", size / calm)):
            for k, joint in enumerate(self.joints):

                def put(spec: Any, param: Any, joint: str = joint, kind: str = kind) -> None:
                    value = float(param.value[0])
                    # damping is a polynomial in speed, of which the first is linear
                    own = spec.joint(joint)
                    setattr(own, kind, [value, 0.0, 0.0] if np.ndim(getattr(own, kind)) else value)

                most = 10.0 * float(top[k])
                found.add(sysid.Parameter(f"{kind}.{joint}", 0.01 * most, 0.0, most, modifier=put))
        model = self.spec.compile()
        for link in self.links:
            body = model.body(link)
            own = tuple(np.array(x) for x in (body.inertia, body.ipos, body.iquat))

            def weigh(spec: Any, param: Any, link: str = link, mass: float = float(body.mass[0]), own=own) -> None:
                body, value = spec.body(link), float(param.value[0])
                body.explicitinertial, body.mass, body.fullinertia = True, value, np.full((6, 1), np.nan)
                body.inertia, body.ipos, body.iquat = own[0] * value / mass, own[1], own[2]

            stated = float(body.mass[0])
            found.add(sysid.Parameter(f"mass.{link}", stated, *(MASSES * stated), modifier=weigh))
        return found

    def torque(self, model: Any, r: Recording) -> NDArray:
        """Torque (m, J) that a model needs along a recording [N·m], in the band."""
        columns = [model.joint(joint).dofadr[0] for joint in self.joints]
        every = max(d for d in range(1, r.stride + 1) if r.stride % d == 0 and (d == 1 or r.rate / d >= FAST))
        data, found = mujoco.MjData(model), np.empty_like(r.q[::every])
        states = zip(*(x[::every] for x in (r.q, r.qd, r.qdd)), strict=True)
        for k, (q, qd, qdd) in enumerate(states):
            data.qpos[columns], data.qvel[columns], data.qacc[columns] = q, qd, qdd
            mujoco.mj_inverse(model, data)
            found[k] = data.qfrc_inverse[columns]
        return low_pass(found, r.rate / every)[:: r.stride // every]

    def effects(self, known: Collection[tuple[str, str]]) -> list[dict[str, Any]]:
        """What the method blames, in the tool's form, the surest first; ``known``: (law, joint) that the model has."""
        names = {"damping": "viscous_friction", "frictionloss": "coulomb_friction", "armature": "rotor_inertia"}
        found = []
        for p in self.parameters:
            name = names.get(p.kind, "inertia_error")
            at = self.links[p.joint] if p.kind == "mass" else self.joints[p.joint]
            if p.moved and (name, at) not in known:
                also = [{"name": "payload_mass", "at": at, "probability": 0.0, "separable": False}]
                own = {"name": name, "at": at, "probability": p.sure, "rivals": also if p.kind == "mass" else []}
                found.append((abs(p.found - p.stated) / p.half if p.half > 0 else np.inf, own))
        return [own for _, own in sorted(found, key=lambda x: -x[0])]


def fitted(urdf: Path, r: Recording, scale: NDArray) -> Fitted:
    """The fit with the friction constraint that leaves least of the recording."""
    return min((Fitted(urdf, r, scale, soft) for soft in SOFT), key=lambda f: f.left)
