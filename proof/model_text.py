"""The model file of a case: what the tool is told of an arm."""

from collections.abc import Collection, Sequence

from bench.concealed import FRICTION, Concealed
from bench.lugre import LuGre

from .plant import ProofPlant


def model_text(
    kinds: Collection[str], hidden: Sequence[Concealed], plant: ProofPlant, secret: Collection[tuple[str, str]]
) -> str:
    """The model file: friction known everywhere but where it is concealed; and the wrong numbers that a case wants."""
    knows = dict.fromkeys((*FRICTION, *(name for h in hidden for name in h.knows)))
    known = [(e, j) for e in knows for j in plant.arm.joints if (e, j) not in secret]
    listed = ", ".join(f'{{name = "{e}", at = "{j}"}}' for e, j in known)
    text = f'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\neffects = [{listed}]\n'
    if "free inertia" in kinds:
        text += 'inertia = "free"\n'
    if "friction values" in kinds:
        text += "[parameters]\n"
        for joint, law in plant.friction.items():
            assert isinstance(law, LuGre)
            text += f'"viscous_friction.{joint}.coefficient" = {2.0 * law.viscous}\n'
            text += f'"coulomb_friction.{joint}.level" = {0.5 * law.level}\n'
    return text
