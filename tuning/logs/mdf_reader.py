"""ASAM MDF (measurement data of CAN recorders and test benches): every group of channels has its own instants."""

from pathlib import Path

import numpy as np

from tuning.logs.recording import Channel, LogError, Recording, needs


def read_mdf(path: Path) -> Recording:
    """The numeric channels of an MDF file, of version 3 or 4.

    Raises:
        LogError: if it is none, or `asammdf` is not installed.
    """
    with needs(path, "MDF files", "mdf"):
        from asammdf import MDF
    try:
        with MDF(path) as file:
            signals = list(file.iter_channels(skip_master=True, copy_master=True))
    except Exception as error:  # asammdf raises what its parser stumbles over: any kind
        raise LogError(f"{path}: not an MDF file: {error}") from None
    channels = [
        Channel(signal.name, np.asarray(signal.samples), signal.unit or "", np.asarray(signal.timestamps, float))
        for signal in signals
        if np.ndim(signal.samples) == 1 and np.asarray(signal.samples).dtype.kind in "biuf"
    ]
    if not channels:
        raise LogError(f"{path}: no channels of numbers in it")
    return Recording(path, tuple(channels))
