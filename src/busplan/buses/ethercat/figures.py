"""The figures that only an EtherCAT bus has."""

from typing import Final

from busplan.buses.figure import NONPERIODIC, BusFigures, Figure, capacity_figures

FRAME: Final = "IEEE 802.3, ETG.1000"

FRAMES: Final = Figure("frames", "F", FRAME, "frames of process data in a cycle", "frames", sort="count", better="less")
PROCESS: Final = Figure(
    "process_bytes", "D", "profile", "process data of all devices", "process data", sort="count", better="less"
)
COMMAND: Final = Figure(
    "command_us",
    "t_cmd",
    "profile",
    "when the last device has taken its command at the latest, from the master's task",
    "last command taken",
    better="less",
)
SYNC0: Final = Figure(
    "sync0_us", "t_sync", "profile", "the first SYNC0 of the distributed clocks after the master's task", "SYNC0"
)
MEAN: Final = Figure(
    "mean_utilisation",
    "U_mean",
    "profile",
    "share of the slice that the mean cycle uses, 0..1; the fullest uses more where groups have every > 1",
    "mean load",
    "%",
    decimals=2,
    better="less",
)
OWN: Final = (FRAMES, PROCESS, COMMAND, SYNC0, MEAN)
TERMS: Final = (
    Figure("cycle_master_us", "T_master", "profile", "the master's own time", "master", ink="contention", letter="M"),
    Figure(
        "cycle_jitter_us",
        "J",
        "profile",
        "how late the frames may start",
        "master's jitter",
        ink="contention",
        letter="J",
    ),
    Figure(
        "cycle_frames_us",
        "frames",
        FRAME,
        "preambles, headers, checks, gaps and padding of the frames, and the master's own datagrams",
        "frame overhead",
        ink="gap",
        letter="F",
    ),
    Figure("cycle_data_us", "data", FRAME, "process data of all devices", "process data", ink="out", letter="D"),
    Figure("cycle_mailbox_us", "mailbox", FRAME, "frames of mailbox polls", "mailbox", ink="acknowledge", letter="B"),
    Figure(
        "cycle_devices_us",
        "devices",
        "DC time stamps",
        "delay of all devices, there and back",
        "devices",
        ink="work",
        letter="H",
    ),
    Figure("cycle_cable_us", "cables", "SOEM", "delay of all cables, there and back", "cables", ink="sync", letter="L"),
    Figure(
        "cycle_receive_us",
        "receive",
        "acontis",
        "the last frame once more, as vendors count its reception",
        "receiving again",
        ink="in",
        letter="R",
    ),
    NONPERIODIC,
)
"""In the order of the wire."""

LATENCY_TABLE: Final = (
    Figure("drive_us", "T_exec", "profile", "the device's own time", "device"),
    Figure("frame_wait_us", "wait", "profile", "wait of feedback for the next frame", "wait for a frame"),
    Figure("pipeline_us", "n T_s", "profile", "cycles that the master computes in", "master's pipeline"),
    Figure("master_us", "T_master", "profile", "the master's own time for a frame", "master"),
    Figure("jitter_us", "J", "profile", "how late the frame may start", "jitter"),
    Figure("sending_us", "sending", FRAME, "all frames of process data on the wire", "sending"),
    Figure("path_us", "path", "DC time stamps", "delay of devices and cables on the way", "devices and cables"),
    Figure(
        "sync_wait_us", "SYNC0", "profile", "wait of a command for SYNC0 of the distributed clocks", "wait for SYNC0"
    ),
    Figure("end_to_end_us", "L", "profile", "all of it", "end to end", better="less"),
)
"""In the order in which they add up."""
FIGURES: Final = BusFigures(
    TERMS,
    capacity_figures(TERMS, own=OWN),
    table=OWN[:-1],
    compared=OWN[:-1],
    planned=(FRAMES.key,),
    phases=LATENCY_TABLE,
    has_many_transactions=True,
)
