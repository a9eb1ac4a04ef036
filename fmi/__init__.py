"""FMU files of any maker: what could harm is refused, the rest unpacked; and how FMI names platforms."""
