"""What the one evidence says of a model and the recordings in a folder."""

from snarelab.identification.arms.kind import ArmRecordings
from snarelab.identification.decision.decide import decide
from snarelab.identification.fitting.experiment import load_experiments, scales, with_silence
from snarelab.models.effects import effects
from snarelab.models.hidden_state import prepare
from snarelab.models.rigid_body import RigidBody


def decided(model, folder):
    prepare(effects().values())
    body = RigidBody(model.tree)
    train = with_silence(load_experiments(model, [folder / "train.csv"], body))
    held = with_silence(load_experiments(model, [folder / "hold.csv"], body, train[0].motion.band))
    return decide(ArmRecordings(model, None, scales(train), train, held))


def names(found):
    return [n.placed.key for n in found.best.names]
