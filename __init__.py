"""Find where a space manipulator's simulation and its recordings disagree, and name the missing physics.

>>> import snarelab
>>> found = snarelab.diagnose("arm3.toml", "sines.csv", holdout="steps.csv")  # doctest: +SKIP
>>> print(found)  # doctest: +SKIP
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .errors import InputError
    from .identification.from_python import check, diagnose, identify, simulate
    from .identification.results import CheckResult, DiagnosisResult, IdentificationResult, ParameterEstimate
    from .models.model import Model
    from .models.model_file import load_model
    from .recordings import read_recording

__version__ = "0.2.0"

__all__ = [
    "CheckResult",
    "DiagnosisResult",
    "IdentificationResult",
    "InputError",
    "Model",
    "ParameterEstimate",
    "check",
    "diagnose",
    "identify",
    "load_model",
    "read_recording",
    "simulate",
]

_PLACES = {
    "CheckResult": ".identification.results",
    "check": ".identification.from_python",
    "DiagnosisResult": ".identification.results",
    "IdentificationResult": ".identification.results",
    "InputError": ".errors",
    "Model": ".models.model",
    "ParameterEstimate": ".identification.results",
    "diagnose": ".identification.from_python",
    "identify": ".identification.from_python",
    "load_model": ".models.model_file",
    "read_recording": ".recordings",
    "simulate": ".identification.from_python",
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for: engines take seconds, and ``snarelab --help`` needs none."""
    if name not in _PLACES:
        raise AttributeError(f"module 'snarelab' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(import_module(_PLACES[name], __name__), name)


def __dir__() -> list[str]:
    """Public names, loaded or not."""
    return sorted({*globals(), *__all__})
