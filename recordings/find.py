"""Finding the public recordings that the examples and benchmarks use.

EMPS, the Electro-Mechanical Positioning System, one prismatic axis, 1 kHz: A. Janot, M. Gautier, M. Brunot, "Data Set
and Reference Models of EMPS", Nonlinear System Identification Benchmarks, 2019. The files are published in the GitHub
repository forgi86/sysid-neural-continuous, ``examples/EMPS/data``. The data pack states no licence of its own, which is
why it is fetched from its publisher and not distributed here.
"""

import os
from pathlib import Path

import pooch

from ..errors import InputError
from .columns import nearest

#: Folder of the files at their publisher, one commit of it.
PUBLISHER = (
    "https://raw.githubusercontent.com/forgi86/sysid-neural-continuous/"
    "956aa7ecd73061b0321c6f6098d74c9e4a7ce67a/examples/EMPS/data/"
)
#: SHA-256 of each file.
SHA256 = {
    "DATA_EMPS.mat": "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e",
    "DATA_EMPS_PULSES.mat": "0eab75bb1f6b16228ee78791343a88bf9bfd9a51036ac9807d7b5fc11c0e1704",
}


def find_recording(name: str) -> Path:
    """Path of ``DATA_EMPS.mat`` (to identify with) or ``DATA_EMPS_PULSES.mat`` (to validate with).

    Looks in the folder ``emps`` of ``$SNARELAB_RECORDINGS``, then of ``../shared/recordings``, then fetches the file
    from its publisher into the user's cache folder. Raises InputError when it cannot be had, when its SHA-256 is not
    the published file's, and for another name.
    """
    if name not in SHA256:
        raise InputError(
            f"recording {name!r} is not a known one; nearest is {nearest(name, SHA256)!r} of {', '.join(SHA256)}"
        )
    set_by_user = os.environ.get("SNARELAB_RECORDINGS")
    folders = [Path(set_by_user)] if set_by_user else []
    places = [folder / "emps" / name for folder in [*folders, Path("..", "shared", "recordings")]]
    for place in places:
        if place.is_file():
            digest = pooch.file_hash(str(place))
            if digest != SHA256[name]:
                raise InputError(
                    f"{place}: SHA-256 {digest[:8]} is not the published file's {SHA256[name][:8]}; replace the file"
                )
            return place
    cache = pooch.create(pooch.os_cache("snarelab"), PUBLISHER, registry=SHA256)
    try:
        return Path(cache.fetch(name))
    except ValueError as error:
        raise InputError(f"{PUBLISHER}{name}: what was fetched is not the published file (SHA-256 differs)") from error
    except OSError as error:  # requests' errors are OSErrors
        looked = ", ".join(map(str, places))
        raise InputError(
            f"recording {name!r} cannot be had: not at {looked}, and not to be fetched from {PUBLISHER} "
            f"({type(error).__name__}); set SNARELAB_RECORDINGS to the folder that holds emps/{name}"
        ) from error
