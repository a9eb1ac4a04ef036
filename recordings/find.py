"""Paths of the public recordings that examples and benchmarks use.

EMPS, the Electro-Mechanical Positioning System, one prismatic axis, 1 kHz: A. Janot, M. Gautier, M. Brunot, "Data Set
and Reference Models of EMPS", Nonlinear System Identification Benchmarks, 2019. The files are published in the GitHub
repository forgi86/sysid-neural-continuous, ``examples/EMPS/data``. The data pack states no licence of its own, which is
why it is fetched from its publisher and not distributed here.

KUKA KR 300 R2500 ultra, six axes, three runs of 10 s at 250 Hz with link-side encoders on axes 1 to 3: J. Weigand et
al., GitHub repository JonasWeigand/Robot_Identification, MIT licence.

BAM, a Dynamixel XL330 servo with a pendulum, 16 runs of 6 s: M. Duclusaud et al., "Extended Friction Models for the
Physics Simulation of Servo Actuators", ICRA 2025; GitHub repository Rhoban/bam, Apache licence 2.0.

Stäubli TX40, six axes with a coupled wrist, 9 s at 5 kHz in two files, positions and currents of the motors: GitHub
repository thanhndv212/figaroh-examples, ``examples/staubli_TX40``.

A cart on a belt, seven runs of 20 s at 150 Hz each of two tests: N. Skov, GitHub repository
nielsSkov/masterThesisMatlab, ``parameterEstimation/data``; no licence is stated.
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
_NGUYEN = (
    "https://raw.githubusercontent.com/thanhndv212/figaroh-examples/"
    "c0b5c7f0fda10078be55104f9ee76ac106b7a5ee/examples/staubli_TX40/data/"
)
_SKOV = (
    "https://raw.githubusercontent.com/nielsSkov/masterThesisMatlab/"
    "0e2c7253fe6e740c36da872508a71c0d1f66a965/parameterEstimation/data/"
)
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
    "pos_read_data.csv": "5cc1cecc1024ef0e331d0caba06f689456ab789ec3f1e904599c0a8be5c27bc8",
    "curr_data.csv": "f4592f4ba4db42f5d7625688986be25b575ca34d0504b27979ca6b0276bd3af9",
    "cartTest2/0m05.csv": "816ad32625bd0aa9b6576ec3a383b5f9f96e803458e41ff85ec5c4ea49fd3613",
    "cartTest2/0m15.csv": "cd64282373ea2f63b97ebdb477a7fbf80c2b095dfd67638101f24c82588974d2",
    "cartTest2/0m25.csv": "d4d29bef118b8bcdaf812292cd85868aa96aea14845e722cca773f91862330cf",
    "cartTest2/0m35.csv": "b828dc6122e54511df4625f3d39b43094e8fd6d43f19017398d81fd5e09bbb55",
    "cartTest2/0m45.csv": "ccf3df28600b3059d895fb1fc360d48be5bd759c994cb3c00b6d31d046b7f10e",
    "cartTest2/0m55.csv": "5de208bea8f14886d99dbdefaa5797d6542b8a57434de62ec3317b9b2e76ecf1",
    "cartTest2/0m65.csv": "ccab6ec88be80491898de62be0f92a477a7b96b55e954ed6f10a4dd8871e8fff",
    "cartTest3/0m05.csv": "838af85619631f40896a2aed27d1fabc403a30fb3c1476508ac95ec275eafd57",
    "cartTest3/0m15.csv": "0212b59b60b51ef9c9e6a845a44eaadff51e9a9bf8c88065160774e3d9f35206",
    "cartTest3/0m25.csv": "8cbb7509d842a7cd1cde45cf9005a3c2fee4166df18814272ea8a1c53bdcd6e1",
    "cartTest3/0m35.csv": "950f667c4e3417a9c856083988bbd2df16b7bda86e6e4798144dec56492cd4e9",
    "cartTest3/0m45.csv": "70155b847480e10b2d9d66f3ed79f1370d17877d9a424a0e37d40cc423f2b57e",
    "cartTest3/0m55.csv": "7467855ea247c00e5b329071cbf24d88b0adddc85f0f4ad07e3b1f786cd120a0",
    "cartTest3/0m65.csv": "ee0b2992602b2b67011cef1f50ed17a157119d7edc27539aa6a054d12800d9a1",
}
#: Folder and address of each file that is not of EMPS.
ELSEWHERE = {
    **{f"run_{run}.mat": ("kuka_kr300", _WEIGAND.format(run)) for run in "ABC"},
    **{name: ("bam/xl330", _RHOBAN + name) for name in SHA256 if name.endswith(".json")},
    **{name: ("tx40", _NGUYEN + name) for name in SHA256 if name.endswith("_data.csv")},
    **{name: ("cart", _SKOV + name) for name in SHA256 if name.startswith("cartTest")},
}


def find_recording(name: str) -> Path:
    """Path of a public recording.

    ``DATA_EMPS.mat`` (to identify with) and ``DATA_EMPS_PULSES.mat`` (to validate with); ``run_A.mat``, ``run_B.mat``
    and ``run_C.mat`` of the KR 300; the servo's 16 runs by date and time, as ``2026-01-15_10h28m10.json``;
    ``pos_read_data.csv`` and ``curr_data.csv`` of the TX40; the cart's runs, as ``cartTest2/0m05.csv``.

    Looks in the folder ``emps``, ``kuka_kr300``, ``bam/xl330``, ``tx40`` or ``cart`` of ``$SNARELAB_RECORDINGS``,
    then of ``../shared/recordings``, then fetches the file from its publisher into the user's cache folder. Raises
    InputError when it cannot be had, when its SHA-256 is not the published file's, and for another name.
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
