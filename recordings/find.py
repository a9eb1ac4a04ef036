"""Finding the public recordings that the examples and benchmarks use.

EMPS, the Electro-Mechanical Positioning System, one prismatic axis, 1 kHz: A. Janot, M. Gautier, M. Brunot, "Data Set
and Reference Models of EMPS", Nonlinear System Identification Benchmarks, 2019. The files are published in the GitHub
repository forgi86/sysid-neural-continuous, ``examples/EMPS/data``. The data pack states no licence of its own, which is
why it is fetched from its publisher and not distributed here.

KUKA KR 300 R2500 ultra, six axes, three runs of 10 s at 250 Hz with link-side encoders on axes 1 to 3: J. Weigand et
al., GitHub repository JonasWeigand/Robot_Identification, MIT licence.

BAM, a Dynamixel XL330 servo with a pendulum, 16 runs of 6 s: M. Duclusaud et al., "Extended Friction Models for the
Physics Simulation of Servo Actuators", ICRA 2025; GitHub repository Rhoban/bam, Apache licence 2.0.
"""

import os
from pathlib import Path

import pooch

from ..errors import InputError, nearest

#: Folder of the files at their publisher, one commit of it.
PUBLISHER = (
    "https://raw.githubusercontent.com/forgi86/sysid-neural-continuous/"
    "956aa7ecd73061b0321c6f6098d74c9e4a7ce67a/examples/EMPS/data/"
)
_WEIGAND = (
    "https://raw.githubusercontent.com/JonasWeigand/Robot_Identification/"
    "9e403c07d9dadbb391a9f3921e8d219f714636a8/data/recorded_trajectories/2020-10-21%2010s%20FF%20{}%2008ms/data.mat"
)
_RHOBAN = "https://raw.githubusercontent.com/Rhoban/bam/af2260462471ff45ac18af159b1327ea51d8db15/bam/data.bak/raw/"
#: SHA-256 of each file.
SHA256 = {
    "DATA_EMPS.mat": "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e",
    "DATA_EMPS_PULSES.mat": "0eab75bb1f6b16228ee78791343a88bf9bfd9a51036ac9807d7b5fc11c0e1704",
    "run_A.mat": "4c152c5b7f2c899731fdeebcf0d011cc103df72be19fac160caf47aa9b73ab75",
    "run_B.mat": "edeb35f65c4ec4bb697e757fc1e4e9668551b6fe7b2c3dbbb526d040dd8d5ce7",
    "run_C.mat": "c5d5688521ece941e6c4afd39643a01cd36ae8c7790342640277f8b15b5515b4",
    "2026-01-15_10h28m10.json": "e58f3c2a08a5e0e37a2c5e930d0830a438bc102b8d21482767124f495b92f2ce",
    "2026-01-15_10h28m17.json": "ef6507934ba465eb31529d7d98715ecc70bd5c87be049fd4618a94ce39290569",
    "2026-01-15_10h28m24.json": "165b171df12b3e8b39504ce36d37e373ad105c0dddf4d3d073c747fd492e8bef",
    "2026-01-15_10h28m32.json": "fdc255edae6995298af437f37582eb8cd0c4a5ddcec4f49fb7c4d6f3303aaa9c",
    "2026-01-15_10h28m42.json": "1c6386bfa3be021c8ca8a96a7cbee93914f6271a050282b1c3b7d5ef373427db",
    "2026-01-15_10h28m49.json": "e2223826274fca7799a2be0cb371e4269ead88cd9077fbb68498ef93e4e0de97",
    "2026-01-15_10h28m57.json": "c10a350d9c7222d4d3499d140edd3ac4e63fe94f3b59a675116a34db7d66152c",
    "2026-01-15_10h29m04.json": "7996c43314a9f60094a6119346b54ff9ff84cb6726c967f4a88a7175278f6515",
    "2026-01-15_10h29m14.json": "016d15d21c464457aa30eaeab3977228b08cd5acf7542f24067440126c0bf480",
    "2026-01-15_10h29m21.json": "fe68cff62e976c87a2fcab925a517fbff83be16c862693310fdc1eff743eddab",
    "2026-01-15_10h29m29.json": "b9ce9fc0f396e6b03bd514e9254cb83b8a64e1a5df1728b9a10e3b4a5a9513ca",
    "2026-01-15_10h29m37.json": "838d390b7190c4ce1608157cf629989648773b7336728a0931a61c6018c6700b",
    "2026-01-15_10h29m47.json": "61ae8eeb881be5d8c09f6c7fba4cef39f66b1ff03e0148ef3bc0e314054513f5",
    "2026-01-15_10h29m54.json": "b50055742ee553a8cb849b38d04d2b9bcf7143d0acefe6539f922984b93d958a",
    "2026-01-15_10h30m02.json": "040e065f9885833fa909683f13665f90048ce5457d94dd2a3af056c21c36210d",
    "2026-01-15_10h30m10.json": "01d32db99e7859f012a230aca59f1dda24219d6781472d356861b138526213e6",
}
#: Folder and address of each file that is not of EMPS.
ELSEWHERE = {
    **{f"run_{run}.mat": ("kuka_kr300", _WEIGAND.format(run)) for run in "ABC"},
    **{name: ("bam/xl330", _RHOBAN + name) for name in SHA256 if name.endswith(".json")},
}


def find_recording(name: str) -> Path:
    """Path of a public recording.

    ``DATA_EMPS.mat`` (to identify with) and ``DATA_EMPS_PULSES.mat`` (to validate with); ``run_A.mat``, ``run_B.mat``
    and ``run_C.mat`` of the KR 300; the servo's 16 runs by date and time, as ``2026-01-15_10h28m10.json``.

    Looks in the folder ``emps``, ``kuka_kr300`` or ``bam/xl330`` of ``$SNARELAB_RECORDINGS``, then of
    ``../shared/recordings``, then fetches the file from its publisher into the user's cache folder. Raises InputError
    when it cannot be had, when its SHA-256 is not the published file's, and for another name.
    """
    if name not in SHA256:
        raise InputError(
            f"recording {name!r} is not a known one; nearest is {nearest(name, SHA256)!r} of {', '.join(SHA256)}"
        )
    set_by_user = os.environ.get("SNARELAB_RECORDINGS")
    folders = [Path(set_by_user)] if set_by_user else []
    folder, address = ELSEWHERE.get(name, ("emps", PUBLISHER + name))
    places = [root / folder / name for root in [*folders, Path("..", "shared", "recordings")]]
    for place in places:
        if place.is_file():
            digest = pooch.file_hash(str(place))
            if digest != SHA256[name]:
                raise InputError(
                    f"{place}: SHA-256 {digest[:8]} is not the published file's {SHA256[name][:8]}; replace the file"
                )
            return place
    cache = pooch.create(pooch.os_cache("snarelab"), PUBLISHER, registry=SHA256, urls={name: address})
    try:
        return Path(cache.fetch(name))
    except ValueError as error:
        raise InputError(f"{address}: what was fetched is not the published file (SHA-256 differs)") from error
    except OSError as error:  # requests' errors are OSErrors
        looked = ", ".join(map(str, places))
        raise InputError(
            f"recording {name!r} cannot be had: not at {looked}, and not to be fetched from {address} "
            f"({type(error).__name__}); set SNARELAB_RECORDINGS to the folder that holds {folder}/{name}"
        ) from error
